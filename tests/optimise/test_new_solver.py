"""A new solver is one file and one registration, and changes no draw of the others."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from gaitopt.core.streams import Stream
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import Request, optimise
from gaitopt.optimise.solvers.registry import SOLVERS
from gaitopt.optimise.solvers.solution import Point, Solution, Stop
from gaitopt.optimise.solvers.solver import Minimisation, draws
from gaitopt.optimise.stages import method_names, method_of
from gaitopt.problem.problem import Problem


@dataclass(frozen=True)
class RandomSteps:
    """A toy: steps from the best point so far, a few at a time."""

    at_once: int = 4

    name: ClassVar[str] = "random-steps"
    stream: ClassVar[Stream] = Stream.SOLVER
    ranks_populations: ClassVar[bool] = False

    def minimise(self, task: Minimisation) -> Solution:
        """Step until the budget is spent."""
        best, lowest, spent = task.x0, np.inf, 0
        while spent < task.budget:
            count = min(self.at_once, task.budget - spent)
            steps = task.spread * task.rng.standard_normal((count, task.box.dimension))
            points: Point = np.clip(best + steps, task.box.low, task.box.high)
            costs = task.evaluate(points)
            spent += count
            if costs.min() < lowest:
                best, lowest = points[costs.argmin()], float(costs.min())
        return Solution(best, lowest, spent, Stop.BUDGET)


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> RandomSteps:
    """The toy in the registry."""
    solver = RandomSteps()
    monkeypatch.setitem(SOLVERS, solver.name, solver)
    return solver


def journal_of(problem: Problem, path: Path, method: str) -> list[str]:
    request = Request(seed=3, budget=10, method=method)
    optimise(problem, request, Journal(path, problem), SerialExecutor())
    return path.read_text().splitlines(keepends=True)


def test_a_registered_solver_is_a_method_and_runs_a_study(
    strider: Problem, tmp_path: Path, registered: RandomSteps
) -> None:
    assert method_names() == ["default", "cma-es", "nelder-mead", "random-steps"]
    assert [stage.solver for stage in method_of("random-steps").stages] == [registered]
    rows = journal_of(strider, tmp_path / "whole.csv", registered.name)
    assert len(rows) == 11
    assert all(row.split(",")[1] == registered.name for row in rows[1:])
    (tmp_path / "cut.csv").write_text("".join(rows[:6]))
    assert journal_of(strider, tmp_path / "cut.csv", registered.name) == rows


def test_a_registered_solver_changes_no_other_search(
    strider: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = journal_of(strider, tmp_path / "before.csv", "default")
    monkeypatch.setitem(SOLVERS, RandomSteps.name, RandomSteps())
    assert journal_of(strider, tmp_path / "after.csv", "default") == before


def test_solvers_without_a_stream_of_their_own_draw_apart() -> None:
    @dataclass(frozen=True)
    class Other(RandomSteps):
        name: ClassVar[str] = "other"

    one, other = draws(RandomSteps(), 1).uniform(size=4), draws(Other(), 1).uniform(size=4)
    assert not np.array_equal(one, other)
    assert np.array_equal(one, draws(RandomSteps(at_once=9), 1).uniform(size=4))
