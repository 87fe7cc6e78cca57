"""Gaits on robots drawn from a posterior: what to expect of each metric, and how far it may be off."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from gaitopt.core.statistics import spread90
from gaitopt.gait.drive import Drive
from gaitopt.optimise.evaluator import Outcome, assess_all, judge
from gaitopt.optimise.verification import evenly
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import Metrics
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.setup import RobotSetup


@dataclass(frozen=True)
class Expected:
    """What to expect of a figure over robots.

    Attributes:
        mean: its mean over the robots that have it; NaN where none has.
        ci90: the interval that holds that of one more robot in 9 of 10 cases (`spread90`).
    """

    mean: float
    ci90: tuple[float, float]

    @staticmethod
    def of(values: Sequence[float]) -> Expected:
        """Return what to expect from the figure of each robot; one that is not finite is left out."""
        array = np.array(values, dtype=float)
        finite = array[np.isfinite(array)]
        return Expected(float(finite.mean()) if len(finite) else np.nan, spread90(array))

    def to_dict(self) -> dict[str, object]:
        """Return the figure for JSON."""
        return {"mean": self.mean, "ci90": list(self.ci90)}


@dataclass(frozen=True)
class OverRobots:
    """One gait, or log of commands, on several robots.

    Attributes:
        robots: how many were simulated.
        failed: how many of them failed; they have no metrics.
        metrics: what to expect of each metric, by name.
        constraints_met: whether no robot failed, and every constraint holds over them.
    """

    robots: int
    failed: int
    metrics: dict[str, Expected]
    constraints_met: bool

    @staticmethod
    def of(problem: Problem, outcomes: Sequence[Outcome]) -> OverRobots:
        """Return what to expect from the outcome on each robot of a problem."""
        names = list(outcomes[0].metrics)
        failed = sum(outcome.status != "ok" for outcome in outcomes)
        metrics = {name: Expected.of([outcome.metrics[name] for outcome in outcomes]) for name in names}
        return OverRobots(len(outcomes), failed, metrics, judge(problem, outcomes).constraints_met)

    @property
    def means(self) -> Metrics:
        """The mean of each metric, by name."""
        return {name: one.mean for name, one in self.metrics.items()}

    def to_dict(self) -> dict[str, object]:
        """Return the figures for JSON."""
        metrics = {name: one.to_dict() for name, one in self.metrics.items()}
        return {"robots": self.robots, "failed": self.failed, "metrics": metrics}


def robots_of(problem: Problem, most: int) -> RobotSetup:
    """Return the robots of a problem, each in the nominal scenario at the working fidelity.

    Args:
        problem: a problem with robots.
        most: most robots; of more, so many that are spread evenly.
    """
    scenarios = tuple(Scenario(effects=robot) for robot in evenly(problem.robots, most))
    return RobotSetup.of(problem, scenarios, problem.simulation.working)


def over_robots(work: Sequence[tuple[RobotSetup, Drive]], executor: Executor) -> list[OverRobots]:
    """Return what to expect of each drive over its robots.

    Args:
        work: robots, see `robots_of`, and what is commanded.
        executor: where the rollouts run.
    """
    units = [(setup, drive, index) for setup, drive in work for index in range(len(setup.scenarios))]
    done = iter(assess_all(units, executor))
    return [OverRobots.of(setup.problem, [next(done) for _ in setup.scenarios]) for setup, _ in work]
