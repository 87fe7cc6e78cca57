"""What several test files need: copies of problem folders, and simple gaits."""

import functools
import math
import shutil
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import tomli_w
from threadpoolctl import threadpool_info

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory

ROBOTS = Path(__file__).parent / "robots"
STRIDER = ROBOTS / "strider"


def problem_folder(
    folder: Path, source: Path, change: Callable[[dict[str, Any]], object] | None = None
) -> Path:
    """Copy a problem folder, and change the content of its problem file."""
    shutil.copytree(source, folder)
    path = folder / "problem.toml"
    content = tomllib.loads(path.read_text())
    if change is not None:
        change(content)
    path.write_text(tomli_w.dumps(content))
    return folder


def complaint(reference: Path | str) -> str:
    """The one line that loading and building a problem ends with."""
    with pytest.raises(GaitoptError) as error:
        build_model(load_problem(reference))
    assert "\n" not in str(error.value)
    return str(error.value)


def edited(path: Path, old: str, new: str) -> Path:
    """Replace a text in a file, which must contain it."""
    text = path.read_text()
    assert old in text, f"{old!r} is not in {path}"
    path.write_text(text.replace(old, new))
    return path


def still(problem: Problem, period_s: float = 0.5) -> Gait:
    """A gait that holds every servo at its start target."""
    held = problem.file.start.ctrl_deg
    return Gait(
        period_s,
        {
            name: Channel(duty=0.5, phase=0.0, amplitude_deg=0.0, offset_deg=held.get(name, 0.0))
            for name in problem.channel_names
        },
        "still",
    )


def blas_threads() -> set[int]:
    """Return on how many threads linear algebra runs, each number once."""
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def same_bits(one: Trajectory, other: Trajectory) -> bool:
    """Whether two trajectories are the same to the last bit."""
    return (
        one.status == other.status
        and list(one.signals) == list(other.signals)
        and np.array_equal(one.time, other.time)
        and all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.signals)
    )


def same_numbers(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Whether two sets of figures are the same to the last bit, NaN being itself."""
    return list(one) == list(other) and all(
        a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(one.values(), other.values(), strict=True)
    )


def brief_studies() -> list[tuple[ModuleType, str, object]]:
    """What to set in which module so that jobs are brief: few starts, samples, pictures and pixels."""
    from gaitopt.diagnose import correction, diagnosis  # which most tests have no need to load
    from gaitopt.diagnose.judge.settings import DiagnosisSettings, ExperimentSettings
    from gaitopt.optimise import settings as searching
    from gaitopt.plan import plan  # which most tests have no need to load
    from gaitopt.report import settings  # which most tests have no need to load
    from gaitopt.simulation.audit import settings as auditing

    brief = functools.partial(plan.PlanSettings, n_samples=6, n_starts=(2, 1, 1), iterations=8)
    jerky = settings.FilmSettings(fps=2.0, loop_rates=(2.0,))
    quick = DiagnosisSettings(experiment=ExperimentSettings(seconds=1.0, random=1, refined=1, finalists=1))
    return [
        (plan, "PlanSettings", brief),
        (searching, "DEFAULT", searching.SearchSettings(plan=brief(), correlation_gaits=4)),
        (diagnosis, "diagnose", functools.partial(diagnosis.diagnose, settings=quick)),
        (correction, "DEFAULT", correction.CorrectionSettings(plan=brief(n_starts=(2, 1, 1), n_elites=3))),
        (auditing, "DEFAULT", auditing.CheckSettings(starts=2)),
        (settings, "DEFAULT", settings.ReportSettings(dpi=40, film=jerky)),
    ]
