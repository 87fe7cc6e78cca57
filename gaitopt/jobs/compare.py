"""The job `compare`: gaits side by side over the same scenarios."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

from gaitopt.core.folders import check_new_or_empty
from gaitopt.gait.gait import Gait
from gaitopt.jobs.executor import opened
from gaitopt.jobs.inputs import checked_seed, found_gait, over_posterior, told_apart
from gaitopt.jobs.outputs import Out, out_folder
from gaitopt.optimise import compare as comparison
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.simulation.objective import check_objective


def compare(
    problem: Problem,
    gaits: Sequence[Gait | str | Path],
    *,
    seed: int = 1,
    executor: Executor | str = "threads",
    workers: int | None = None,
    out: Out = None,
    posterior: Path | str | None = None,
) -> list[comparison.ComparedGait]:
    """Compare gaits over the same scenarios, each with the first.

    Args:
        problem: the problem.
        gaits: gaits, or what `Problem.find_gait` finds by name or path.
        seed: seed of the scenarios.
        executor: where rollouts run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
            executor.
        workers: rollouts at once; all cores by default.
        out: a new or an empty folder for the page; nothing is written without it.
        posterior: the run folder of a diagnosis; each scenario then runs on one of its robots, and intervals
            are over robots.

    Returns:
        The figures of each gait, in order.

    Raises:
        GaitoptError: a gait, the posterior or the objective does not fit the problem, or `out` holds
            something.
    """
    folder = out_folder(out)
    check_new_or_empty(folder)
    problem = over_posterior(carrying(problem), posterior)
    check_objective(problem)
    found = told_apart(problem, [found_gait(problem, gait) for gait in gaits], gaits)
    seed = checked_seed(seed)
    with opened(executor, workers) as pool:
        rows = comparison.compare(problem, found, seed, pool)
    if out is not None:
        from gaitopt.report.comparison import write_comparison

        write_comparison(folder, problem, found, rows, seed)
    return rows
