"""The job `export`: a gait as a table and a player, after a simulation of both."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path

from gaitopt.core.folders import check_new_or_empty
from gaitopt.export.handover import Choices, Exported, prepare
from gaitopt.gait.gait import Gait
from gaitopt.jobs.executor import opened
from gaitopt.jobs.inputs import found_gait
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem


def export(
    problem: Problem,
    gait: Gait | str | Path,
    choices: Choices | str,
    out: Path | str,
    *,
    executor: Executor | str = "threads",
    workers: int | None = None,
) -> Exported:
    """Write a gait for a servo board, after it was played in simulation as the servos will get it.

    Args:
        problem: the problem.
        gait: a gait, or what `Problem.find_gait` finds by name or path.
        choices: the format (``c``, ``arduino``, ``esp-idf``, ``micropython``, ``csv`` or ``json``), or the
            format with further choices.
        out: a new or an empty folder.
        executor: where rollouts run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
            executor.
        workers: rollouts at once; all cores by default.

    Raises:
        GaitoptError: the gait leaves a servo's range, a pin is missing or used twice, or `out` holds
            something.
    """
    problem = carrying(problem)
    found = found_gait(problem, gait, in_range=False)
    check_new_or_empty(Path(out))
    wanted = Choices(choices) if isinstance(choices, str) else choices
    with opened(executor, workers) as pool:
        handover = prepare(problem, found, wanted, pool)
    return handover.write(Path(out))
