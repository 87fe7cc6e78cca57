"""The job `sweep`: one gait over a range of one parameter."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.errors import GaitoptError
from gaitopt.core.folders import check_new_or_empty
from gaitopt.gait.gait import Gait
from gaitopt.jobs.executor import opened
from gaitopt.jobs.inputs import found_gait, over_posterior
from gaitopt.jobs.outputs import Out, out_folder
from gaitopt.optimise import sweep as sweeping
from gaitopt.optimise.sweep import Sweep, SweptPoint
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem


@dataclass(frozen=True)
class SweepRun:
    """A finished sweep.

    Attributes:
        rows: one row of metrics for each value.
        folder: where the plots and ``sweep.json`` are; None where nothing was written.
    """

    rows: list[SweptPoint]
    folder: Path | None


def sweep(
    problem: Problem,
    gait: Gait | str | Path | None = None,
    *,
    over: str,
    executor: Executor | str = "threads",
    workers: int | None = None,
    out: Out = None,
    posterior: Path | str | None = None,
) -> SweepRun:
    """Simulate a gait over a range of one parameter, on the nominal robot.

    Args:
        problem: the problem.
        gait: a gait, or what `Problem.find_gait` finds by name or path; the first baseline by default.
        over: ``NAME=V1,V2,…``, where NAME is ``period_s``, ``CHANNEL.KEY`` or a named model parameter.
        executor: where rollouts run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
            executor.
        workers: rollouts at once; all cores by default.
        out: a new or an empty folder for the plots; nothing is written without it.
        posterior: the run folder of a diagnosis; some of its robots are simulated beside the nominal one.

    Raises:
        GaitoptError: there is no such gait, parameter or posterior, a value is not allowed, or `out` holds
            something.
    """
    check_new_or_empty(out_folder(out))
    problem = over_posterior(carrying(problem), posterior)
    chosen = _first_baseline(problem) if gait is None else found_gait(problem, gait)
    asked = Sweep.parse(over)
    points = asked.points(problem, chosen)
    with opened(executor, workers) as pool:
        rows = sweeping.sweep(points, pool)
    if out is None:
        return SweepRun(rows, None)
    from gaitopt.report.sweep import write_sweep

    return SweepRun(rows, write_sweep(out_folder(out), problem, asked, points, rows))


def _first_baseline(problem: Problem) -> Gait:
    if not problem.baselines:
        raise GaitoptError(f"{problem.source}: no baselines; name a gait")
    return next(iter(problem.baselines.values()))
