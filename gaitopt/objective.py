"""From metrics to one cost: named terms and named constraints, all of them reported."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from gaitopt.errors import unknown_name
from gaitopt.metrics import METRICS, Metrics, mean_metrics
from gaitopt.problem import Constraint, Problem

FAILED_COST = 1e6
"""Cost of a gait whose simulation failed: worse than anything that a robot can do."""

_WORST_VIOLATION = 1e3


@dataclass(frozen=True)
class Evaluation:
    """What a gait is worth over some scenarios.

    Attributes:
        cost: what the search minimises.
        metrics: mean of each metric over the scenarios.
        violations: by how much of its scale each constraint is exceeded; 0 where it is met.
        status: ``ok``, or why a scenario failed.
    """

    cost: float
    metrics: Metrics
    violations: dict[str, float]
    status: str

    @property
    def constraints_met(self) -> bool:
        """Whether every simulation went well and every constraint holds."""
        return self.status == "ok" and not any(self.violations.values())


def check_objective(problem: Problem) -> None:
    """Check that every term and constraint is a metric.

    Raises:
        GaitoptError: a name is not a metric.
    """
    known = [*METRICS, *(f"reached.{name}" for name in problem.channel_names)]
    for key in ("terms", "constraints"):
        for name in getattr(problem.file.objective, key):
            if name not in known:
                raise unknown_name(f"{problem.source}: objective.{key}", "metric", name, known)


def evaluate(
    problem: Problem, rows: Sequence[Metrics], statuses: Sequence[str], margin: float = 0.0
) -> Evaluation:
    """Return the evaluation of one gait from its metrics in each scenario.

    The cost is the weighted sum of the mean metrics plus, for each constraint, the problem's penalty
    times the violation by the mean metric, in units of the constraint's scale.

    Args:
        problem: the problem, for its objective.
        rows: metrics in each scenario.
        statuses: status of each scenario.
        margin: share by which every limit is tightened.
    """
    objective = problem.file.objective
    failed = next((status for status in statuses if status != "ok"), None)
    if failed is not None:
        return Evaluation(FAILED_COST, mean_metrics(list(rows)), {}, failed)
    metrics = mean_metrics(list(rows))
    violations = {name: _violation(c, metrics[name], margin) for name, c in objective.constraints.items()}
    cost = sum(weight * metrics[name] for name, weight in objective.terms.items())
    cost += objective.penalty * sum(violations.values())
    return Evaluation(cost if math.isfinite(cost) else FAILED_COST, metrics, violations, "ok")


def _violation(constraint: Constraint, value: float, margin: float) -> float:
    if math.isnan(value):
        return _WORST_VIOLATION
    over = under = 0.0
    if constraint.max is not None:
        over = max(0.0, value - (constraint.max - margin * abs(constraint.max)))
    if constraint.min is not None:
        under = max(0.0, constraint.min + margin * abs(constraint.min) - value)
    excess = over + under
    return min(excess / constraint.scale, _WORST_VIOLATION)
