"""Gaits side by side over the same scenarios."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import interval90
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED, Metrics
from gaitopt.simulation.setup import RobotSetup


@dataclass(frozen=True)
class ComparedGait:
    """One gait of a comparison, with its differences from the first gait over the same scenarios.

    Attributes:
        name: name of the gait.
        period_s: its period, s.
        speed_ci90_m_s: 90 % interval of the mean forward speed, m/s.
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
        metrics: mean of each metric over the scenarios.
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

    @property
    def speed_m_s(self) -> float:
        """Mean forward speed, m/s."""
        return self.metrics[SPEED.name]

    def to_dict(self) -> dict[str, Any]:
        """Return the row of ``compare.json``: the figures, then the metrics."""
        row = dict(vars(self))
        metrics: Metrics = row.pop("metrics")
        return {
            key: list(value) if isinstance(value, tuple) else value for key, value in row.items()
        } | metrics


def compare(problem: Problem, gaits: Sequence[Gait], seed: int, executor: Executor) -> list[ComparedGait]:
    """Return one row per gait: mean speed with interval, and its paired difference to the first gait.

    Every gait runs in the same scenarios, so that difference and ratio of two are judged scenario by
    scenario.

    Args:
        problem: the problem.
        gaits: the gaits; the first is what the others are compared with.
        seed: seed of the scenarios.
        executor: where the rollouts run.

    Raises:
        GaitoptError: the problem has no marker, whose speed is compared.
    """
    problem.require("compare", "roles.marker")
    scenarios = scenarios_of(problem, seed, Stream.VERIFICATION_SCENARIOS)
    evaluator = Evaluator(RobotSetup.of(problem, scenarios, problem.simulation.working), executor)
    rows: list[ComparedGait] = []
    first: NDArray[np.float64] | None = None
    for gait, one in zip(gaits, evaluator(gaits), strict=True):
        speeds = np.array([outcome.metrics[SPEED.name] for outcome in one.outcomes])
        first = speeds if first is None else first
        low, high = interval90(speeds - first)
        ratio = paired_ratio(speeds, first)
        rows.append(
            ComparedGait(
                name=gait.name,
                period_s=gait.period_s,
                speed_ci90_m_s=interval90(speeds),
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
            )
        )
    return rows


@dataclass(frozen=True)
class Ratio:
    """A ratio of two means with its 90 % interval."""

    value: float
    ci90: tuple[float, float]


def paired_ratio(speeds: NDArray[np.float64], first: NDArray[np.float64]) -> Ratio | None:
    """Return the ratio of two mean speeds over the same scenarios, or None where it has no meaning.

    The interval is by the delta method: the error of the ratio r is the mean of (a - r b) / mean(b) over the
    scenarios.

    Args:
        speeds: speeds a, m/s, shape (n,).
        first: speeds b to compare with, m/s, shape (n,). The 90 % interval of their mean must be above 0.
    """
    if not interval90(first)[0] > 0.0:
        return None
    ratio = float(speeds.mean() / first.mean())
    return Ratio(ratio, interval90(ratio + (speeds - ratio * first) / first.mean()))
