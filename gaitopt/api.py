"""The same jobs as the command line's, from Python: records and arrays in, records and arrays out.

from gaitopt.api import Problem, compare, diagnose, optimise, simulate
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from gaitopt.core.errors import unknown_name
from gaitopt.core.files import write_text
from gaitopt.core.folders import check_new_or_empty
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.diagnosis import diagnose as _diagnose
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.words import answer
from gaitopt.effects import EFFECTS
from gaitopt.gait.gait import Channel, Gait, read_gait, write_gait
from gaitopt.optimise.compare import ComparedGait
from gaitopt.optimise.compare import compare as _compare
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import DEFAULT_BUDGET, Optimised, Request
from gaitopt.optimise.run import optimise as _optimise
from gaitopt.optimise.study import Progress
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.runs.run_folder import RunFolder
from gaitopt.simulation.check import Finding, check
from gaitopt.simulation.metrics import Metrics, measure
from gaitopt.simulation.objective import check_objective
from gaitopt.simulation.rollout import Simulator

__all__ = [
    "Channel",
    "Diagnosis",
    "Finding",
    "Gait",
    "Metrics",
    "Optimised",
    "Problem",
    "Rollout",
    "Trajectory",
    "answer",
    "audit",
    "compare",
    "diagnose",
    "film",
    "optimise",
    "read_gait",
    "simulate",
    "write_gait",
]


@dataclass(frozen=True)
class Rollout:
    """One simulated gait: its time series and its metrics."""

    gait: Gait
    trajectory: Trajectory
    metrics: Metrics


def simulate(problem: Problem, gait: Gait | str, csv: Path | str | None = None) -> Rollout:
    """Simulate one gait on the nominal robot.

    Args:
        problem: the problem.
        gait: a gait, or what `Problem.find_gait` finds by name or path.
        csv: where to write the time series.
    """
    gait = _gait(problem, gait)
    simulator = Simulator.build(problem)
    trajectory = simulator.run(gait)
    if csv is not None:
        write_text(Path(csv), simulator.observe(trajectory).to_csv())
    return Rollout(gait, trajectory, measure(problem, gait, trajectory, Robot.of(simulator.models[0])))


def film(
    problem: Problem, gaits: Sequence[Gait | str], path: Path | str, seconds: float | None = None
) -> Path:
    """Film gaits side by side: ``.mp4``, ``.gif`` or ``.webp``."""
    from gaitopt.report.film.film import film_length, write_film
    from gaitopt.report.film.take import take

    found = [_gait(problem, gait) for gait in gaits]
    simulator, length = Simulator.build(problem), seconds or film_length(found)
    write_film(Path(path), [take(simulator, gait, length) for gait in found], end=length)
    return Path(path)


def compare(
    problem: Problem,
    gaits: Sequence[Gait | str],
    seed: int = 1,
    workers: int | None = None,
    out: Path | str | None = None,
) -> list[ComparedGait]:
    """Return one row of figures for each gait over the same scenarios, each against the first.

    Args:
        problem: the problem.
        gaits: gaits, or what `Problem.find_gait` finds by name or path.
        seed: seed of the scenarios.
        workers: rollouts at once; all cores by default.
        out: a new folder for the command's page.
    """
    folder = _new_folder(out)
    check_objective(problem)
    found = [_gait(problem, gait) for gait in gaits]
    with open_executor("threads", workers) as executor:
        rows = _compare(problem, found, seed, executor)
    if folder is not None:
        from gaitopt.report.comparison import write_comparison

        write_comparison(folder, problem, found, rows, seed)
    return rows


def audit(problem: Problem, workers: int | None = None, out: Path | str | None = None) -> list[Finding]:
    """Return what `gaitopt check` finds.

    Args:
        problem: the problem.
        workers: rollouts at once; all cores by default.
        out: a new folder for the command's page.
    """
    folder = _new_folder(out)
    with open_executor("threads", workers) as executor:
        findings = check(problem, executor)
    if folder is not None:
        from gaitopt.report.audit import write_audit

        write_audit(folder, problem, findings)
    return findings


def optimise(
    problem: Problem,
    budget: int = DEFAULT_BUDGET,
    seed: int = 1,
    method: str = "default",
    warm_start: bool = True,
    workers: int | None = None,
    out: Path | str | None = None,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> Optimised:
    """Search for a better gait and verify it beside the hand-tuned ones.

    Args:
        problem: the problem.
        budget: gaits to evaluate.
        seed: seed of all randomness.
        method: ``default``, ``cma-es`` or ``nelder-mead``.
        warm_start: start from planned gaits, where the problem says how.
        workers: rollouts at once; all cores by default.
        out: a run folder to write, as the command does; nothing is left behind without it.
        on_progress: called as each batch ends.
    """
    problem, request = carrying(problem), Request(seed, budget, method, warm_start)
    with open_executor("threads", workers) as executor:
        if out is None:
            with TemporaryDirectory() as folder:
                journal = Journal(Path(folder) / "evaluations.csv", problem)
                return _optimise(problem, request, journal, executor, on_progress)
        from gaitopt.report.search import write_report

        with RunFolder.create(Path(out), problem, request) as run:
            optimised = _optimise(problem, request, Journal(run.journal, problem), executor, on_progress)
            write_report(run, problem, optimised)
            run.write_results(problem, optimised)
            return optimised


def diagnose(
    problem: Problem,
    dataset: Path | str,
    effects: Collection[str] | None = None,
    seed: int = 1,
    next_gait: bool = True,
    workers: int | None = None,
    out: Path | str | None = None,
    on_progress: Callable[[str, int, int], None] = lambda what, done, most: None,
) -> Diagnosis:
    """Say where the gap between measured trials and simulation lies, what causes it and what to measure next.

    Args:
        problem: the nominal robot.
        dataset: folder with ``dataset.toml`` and its trials.
        effects: names of the effects to try; all that apply by default.
        seed: seed of all randomness.
        next_gait: whether to look for the gait to measure next.
        workers: rollouts at once; all cores by default.
        out: a run folder to write, as the command does; nothing is left behind without it.
        on_progress: called with what is being done, how many robots have been simulated for it, and how many
            may be at most (0 where that is not known).

    Raises:
        GaitoptError: the data set is wrong, an effect is unknown or none applies, or `out` holds something.
    """
    folder = _new_folder(out)
    for name in effects or ():
        if name not in EFFECTS:
            raise unknown_name("diagnose", "effect:", name, EFFECTS)
    problem = carrying(problem)  # its files may change meanwhile
    simulator = Simulator.build(problem)
    trials = load_dataset(Path(dataset), problem, [name for name in simulator.signals if name])
    with open_executor("threads", workers) as executor:
        if folder is None:
            return _diagnose(simulator, trials, executor, seed, on_progress, next_gait, effects)
        from gaitopt.report.diagnosis_report import diagnosis_folder, write_diagnosis

        with diagnosis_folder(folder, None, problem.name):
            memory = SimulationCache.of(folder, simulator, trials, seed)
            found = _diagnose(simulator, trials, executor, seed, on_progress, next_gait, effects, memory)
            write_diagnosis(folder, problem, found, executor)
            memory.clear()
            return found


def _gait(problem: Problem, gait: Gait | str) -> Gait:
    return problem.find_gait(gait) if isinstance(gait, str) else problem.check_gait(gait, gait.name or "gait")


def _new_folder(out: Path | str | None) -> Path | None:
    """Return the folder that a job is to write, which must be new or empty."""
    folder = None if out is None else Path(out)
    check_new_or_empty(folder)
    return folder
