"""Searches like those of the main job, without a run folder."""

from pathlib import Path

from gaitopt.core.json import to_json
from gaitopt.core.progress import Progress
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import Optimised, Request, optimise
from gaitopt.problem.problem import Problem
from gaitopt.runs.summary import Summary

BUDGET = 24


def run(
    problem: Problem,
    path: Path,
    request: Request,
    workers: int = 1,
    executor: str = "threads",
    progress: list[Progress] | None = None,
) -> Optimised:
    """Run the main job with its journal at `path`."""
    seen: list[Progress] = [] if progress is None else progress
    with open_executor(executor, workers) as pool:
        return optimise(problem, request, Journal(path, problem), pool, seen.append)


def summary(problem: Problem, optimised: Optimised) -> str:
    """The summary without the one figure that comes from a clock."""
    content = Summary.of(problem, optimised).to_dict()
    assert content.pop("wall_s") > 0.0
    return to_json(content)
