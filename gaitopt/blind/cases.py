"""Blind cases: data sets with a sealed truth, made by numerics that the diagnosis does not use."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from gaitopt.blind.disturbances import OUTSIDE
from gaitopt.blind.drawing import draw_case
from gaitopt.blind.factory import CaseFactory, RecordingPlan
from gaitopt.blind.recording import check_file_names, record, write_recording
from gaitopt.blind.sealed import Truth, seal, truth_path
from gaitopt.blind.settings import DEFAULT, BlindSettings
from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.core.files import write_bytes
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.streams import Stream, generator
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.model import assets_beside, nominal_mjcf
from gaitopt.problem.problem import Problem

NOMINAL_FOLDER = "nominal"
"""Where a folder of cases keeps the problem that they are diagnosed with."""

_MODEL_FILE = "model.xml"


@dataclass(frozen=True)
class CaseRequest:
    """Which cases are made.

    Attributes:
        kinds: the kind of each case.
        seed: seed of all randomness.
        plan: what is recorded in each.
        only: the effect or disturbance to plant; None for any.
    """

    kinds: Sequence[str]
    seed: int
    plan: RecordingPlan
    only: str | None = None


def kinds_of(cases: int, seed: int, settings: BlindSettings = DEFAULT) -> list[str]:
    """Return the kinds of `cases` cases, in the settings' shares, in random order."""
    counts = {kind: round(share * cases) for kind, share in settings.shares.items()}
    counts["single"] += cases - sum(counts.values())
    kinds = [kind for kind, count in counts.items() for _ in range(count)]
    generator(seed, Stream.BLIND_KINDS).shuffle(kinds)
    return kinds


def nominal_files(problem: Problem) -> dict[str, bytes]:
    """Return the content of each file in `NOMINAL_FOLDER`, by its path there."""
    texts = {_MODEL_FILE: nominal_mjcf(problem), PROBLEM_FILE: problem.to_toml(_MODEL_FILE)}
    return assets_beside(problem) | {name: text.encode() for name, text in texts.items()}


def case_name(index: int) -> str:
    """Return the name of a case."""
    return f"case-{index:03d}"


def make_cases(
    problem: Problem,
    out: Path,
    request: CaseRequest,
    executor: Executor,
    on_progress: OnProgress = silent,
    settings: BlindSettings = DEFAULT,
) -> list[str]:
    """Make cases, those that exist already kept; return the effects drawn that could make no gap.

    Args:
        problem: the problem.
        out: their folder, where `NOMINAL_FOLDER` keeps the problem.
        request: which cases.
        executor: where robots are simulated.
        on_progress: called before each case.
        settings: how cases are drawn.

    Raises:
        GaitoptError: there is no marker, no such gait or signal, a gait's name cannot name a file, or what is
            to be planted cannot make a gap.
    """
    problem.require("blind make", "roles.marker")
    check_file_names(request.plan.gaits)
    factory = CaseFactory.of(problem, request.plan, executor, settings)
    _check_only(factory, request)
    nominal = out / NOMINAL_FOLDER
    for name, data in nominal_files(problem).items():
        (nominal / name).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(nominal / name, data)
    faint: set[str] = set()
    for index, kind in enumerate(request.kinds):
        on_progress(Progress("making cases", index, len(request.kinds), "cases"))
        if not truth_path(out, case_name(index)).exists():
            faint.update(make_case(factory, out, index, kind, request, executor))
    return sorted(faint)


def _check_only(factory: CaseFactory, request: CaseRequest) -> None:
    """Check that every case can have what is to be planted."""
    if request.only is None:
        return
    known = {"single": factory.effects, "outside": list(OUTSIDE)}
    if request.only not in [*OUTSIDE, *factory.effects]:
        known_names = [name for names in known.values() for name in names]
        raise unknown_name("blind make", "effect or disturbance", request.only, known_names)
    for kind in request.kinds:
        if request.only not in known.get(kind, ()):
            allowed = "an effect with --kind single, a disturbance with --kind outside"
            raise bad_value("blind make", "--only", request.only, allowed)


def make_case(
    factory: CaseFactory, out: Path, index: int, kind: str, request: CaseRequest, executor: Executor
) -> list[str]:
    """Make one case and seal its truth; return the effects drawn that could make no gap.

    Args:
        factory: what all cases share.
        out: the folder of the cases.
        index: number of the case, which decides its random draws.
        kind: one of `kinds.KINDS`.
        request: its seed, and what to plant.
        executor: where robots are simulated.

    Raises:
        GaitoptError: no draw makes a gap by other numerics.
    """
    rng = generator(request.seed, Stream.BLIND_CASE, index)
    settings = factory.settings
    faint: list[str] = []
    for _ in range(settings.cases_tried):
        sized = draw_case(factory, kind, rng, executor, request.only)
        faint += sized.faint
        recording = record(factory, sized.draw, rng, executor)
        if kind == "none" or settings.fits(recording.gap, settings.excess * settings.largest):
            break
    else:
        least, what = settings.smallest, request.only or kind
        raise GaitoptError(f"{what}: no robot of other numerics showed a gap of {least:g} floors")
    write_recording(factory, recording, out / case_name(index), rng)
    truth = Truth(
        kind=kind,
        effects=sized.draw.rows,
        gap_over_floor=recording.gap,
        figures=dict(recording.figures),
        seen=dict(recording.seen),
        seen_beside_errors=dict(recording.seen_beside_errors),
        trials=tuple(recording.paths),
        misfits={name: misfit.name for name, misfit in recording.misfits.items()},
        misfits_beside_errors=dict(recording.misfits_beside_errors),
        errors=tuple(recording.errors),
        speeds_m_s=dict(recording.speeds),
    )
    seal(out, case_name(index), truth)
    return faint
