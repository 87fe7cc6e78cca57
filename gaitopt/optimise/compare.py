"""Gaits side by side over the same scenarios."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import interval90, spread90
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.verification import scenarios_of, scenarios_on_every_robot
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED, Metrics
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.setup import RobotSetup

COMPARED = 64
"""Most robots of a posterior that gaits are compared on."""


@dataclass(frozen=True)
class ComparedGait:
    """One gait of a comparison, with its differences from the first gait over the same scenarios.

    Attributes:
        name: name of the gait.
        period_s: its period, s.
        speed_ci90_m_s: 90 % interval of the mean forward speed, m/s; over robots of a posterior, the interval
            that holds the speed of 90 % of them. So it is of the difference and of the ratio.
        speed_worst_m_s: forward speed in the worst scenario, m/s.
        difference_m_s: mean speed less that of the first gait, m/s.
        difference_ci90_m_s: 90 % interval of the paired difference, m/s.
        ratio: mean speed over that of the first gait; None where the first gait may not go forward.
        ratio_ci90: 90 % interval of the ratio, or None.
        more_than_noise: whether the interval of the difference is on one side of 0.
        constraints_met: whether every simulation went well and every constraint holds.
        violations: constraints that do not hold, each with its excess in units of its scale.
        status: ``ok``, or why a scenario failed.
        scenario_speeds_m_s: forward speed in each scenario, m/s.
        robots: robots of a posterior, each in its own scenario; 0 where every scenario has the nominal one.
        metrics: mean of each metric over the scenarios.
        timestep_s, integrator: the fidelity: the reference, as of a search's winner.
    """

    name: str
    period_s: float
    speed_ci90_m_s: tuple[float, float]
    speed_worst_m_s: float
    difference_m_s: float
    difference_ci90_m_s: tuple[float, float]
    ratio: float | None
    ratio_ci90: tuple[float, float] | None
    more_than_noise: bool
    constraints_met: bool
    violations: dict[str, float]
    status: str
    scenario_speeds_m_s: tuple[float, ...]
    metrics: Metrics
    robots: int = 0
    timestep_s: float = math.nan
    integrator: str = ""

    @property
    def speed_m_s(self) -> float:
        """Mean forward speed, m/s."""
        return self.metrics[SPEED.name]

    def to_dict(self) -> dict[str, Any]:
        """Return the row of ``compare.json``: the figures, then the metrics."""
        row = dict(vars(self))
        metrics: Metrics = row.pop("metrics")
        if not self.robots:
            del row["robots"]
        return {
            key: list(value) if isinstance(value, tuple) else value for key, value in row.items()
        } | metrics


def compared_scenarios(problem: Problem, seed: int) -> tuple[Scenario, ...]:
    """Return the scenarios that gaits are compared in.

    Each robot of a posterior has one, at most `COMPARED` of them. Without such robots they are those with
    which a search of the same seed verifies its winner.

    Args:
        problem: the problem.
        seed: seed of the scenarios.
    """
    if problem.robots:
        return scenarios_on_every_robot(problem, seed, COMPARED)
    return scenarios_of(problem, seed, Stream.VERIFICATION_SCENARIOS)


def compare(problem: Problem, gaits: Sequence[Gait], seed: int, executor: Executor) -> list[ComparedGait]:
    """Return one row per gait: mean speed with interval, and its paired difference to the first gait.

    Scenarios (`compared_scenarios`) and fidelity are those of a winner, so a gait has one speed. Every gait
    runs in the same scenarios, so that difference and ratio of two are judged scenario by scenario. There is
    one real robot, so over robots of a posterior intervals say where it may lie, and not where the mean does.

    Args:
        problem: the problem.
        gaits: the gaits; the first is what the others are compared with.
        seed: seed of the scenarios.
        executor: where the rollouts run.

    Raises:
        GaitoptError: the problem has no marker, whose speed is compared.
    """
    problem.require("compare", "roles.marker")
    scenarios, interval = compared_scenarios(problem, seed), spread90 if problem.robots else interval90
    fidelity = problem.simulation.reference
    evaluator = Evaluator(RobotSetup.of(problem, scenarios, fidelity), executor)
    rows: list[ComparedGait] = []
    first: NDArray[np.float64] | None = None
    for gait, one in zip(gaits, evaluator(gaits), strict=True):
        speeds = np.array([outcome.metrics[SPEED.name] for outcome in one.outcomes])
        first = speeds if first is None else first
        low, high = interval(speeds - first)
        ratio = paired_ratio(speeds, first, interval)
        rows.append(
            ComparedGait(
                name=gait.name,
                period_s=gait.period_s,
                speed_ci90_m_s=interval(speeds),
                speed_worst_m_s=float(speeds.min()),
                difference_m_s=float((speeds - first).mean()),
                difference_ci90_m_s=(low, high),
                ratio=ratio.value if ratio else None,
                ratio_ci90=ratio.ci90 if ratio else None,
                more_than_noise=low > 0.0 or high < 0.0,
                constraints_met=one.evaluation.constraints_met,
                violations={n: v for n, v in one.evaluation.violations.items() if v > 0.0},
                status=one.evaluation.status,
                scenario_speeds_m_s=tuple(speeds.tolist()),
                metrics=one.evaluation.metrics,
                robots=len(scenarios) if problem.robots else 0,
                timestep_s=fidelity.timestep_s,
                integrator=fidelity.integrator,
            )
        )
    return rows


@dataclass(frozen=True)
class Ratio:
    """A ratio of two means with its 90 % interval."""

    value: float
    ci90: tuple[float, float]


Interval = Callable[[NDArray[np.float64]], tuple[float, float]]
"""Returns an interval from independent values: of their mean, or of the values."""


def paired_ratio(
    speeds: NDArray[np.float64], first: NDArray[np.float64], interval: Interval = interval90
) -> Ratio | None:
    """Return the ratio of two mean speeds over the same scenarios, or None where it has no meaning.

    The interval is by the delta method: the error of the ratio r is the mean of (a - r b) / mean(b) over the
    scenarios.

    Args:
        speeds: speeds a, m/s, shape (n,).
        first: speeds b to compare with, m/s, shape (n,). Their interval must be above 0.
        interval: the kind of interval.
    """
    if not interval(first)[0] > 0.0:
        return None
    ratio = float(speeds.mean() / first.mean())
    return Ratio(ratio, interval(ratio + (speeds - ratio * first) / first.mean()))
