"""From metrics to one cost: named terms and constraints, all of them reported."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.problem.objective import Constraint, Objective
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import AIMS, Metrics, mean_metrics, metric_names

FAILED_COST = 1e6
"""Cost of a gait whose simulation failed: worse than any possible cost of a robot."""

_WORST_VIOLATION = 1e3
"""Largest violation of a constraint, in its scale: also that of a metric that is NaN."""

_NO_OBJECTIVE = Objective(terms={})


@dataclass(frozen=True)
class Evaluation:
    """The evaluation of a gait over some scenarios.

    Attributes:
        cost: what the search minimises.
        metrics: mean of each metric over the scenarios.
        violations: excess over each constraint, in units of its scale; 0 where it is met. It is that of the
            mean metric, or as `Objective.over_scenarios` says.
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
    """Check that every term and constraint is a metric; a problem without ``[objective]`` has none.

    Raises:
        GaitoptError: a name is not a metric.
    """
    if problem.file.objective is None:
        return
    known = metric_names(problem, unused=True)
    for key in ("terms", "constraints"):
        for name in getattr(problem.objective, key):
            if name not in known:
                raise unknown_name(f"{problem.source}: objective.{key}", "metric", name, known)
            needed = AIMS[name].needs if name in AIMS else ""
            if needed and getattr(problem.objective, needed) is None:
                raise GaitoptError(f"{problem.source}: objective.{needed}: missing; {name} needs it")


def check_searchable(problem: Problem) -> None:
    """Check that a problem has what a search needs: bounds, an objective, and a marker.

    Raises:
        GaitoptError: an optional part that a search needs is missing, or the objective names no metric.
    """
    problem.require("optimise", "[gait]", "[objective]", "roles.marker")
    check_objective(problem)


def evaluate(
    problem: Problem, rows: Sequence[Metrics], statuses: Sequence[str], margin: float = 0.0
) -> Evaluation:
    """Return the evaluation of one gait from its metrics in each scenario.

    The cost is the weighted sum of the mean metrics, plus a penalty for each constraint. This is the
    problem's penalty times the violation by the mean metric, in units of the constraint's scale. If the
    problem sets the worst scenario or a quantile, that of the scenarios' weighted sums is used instead of the
    mean. The same holds for each constraint's violations. Without ``[objective]`` the cost is 0, and nothing
    is violated.

    Args:
        problem: the problem, for its objective.
        rows: metrics in each scenario.
        statuses: status of each scenario.
        margin: share by which every limit is tightened.
    """
    objective = problem.file.objective or _NO_OBJECTIVE
    failed = next((status for status in statuses if status != "ok"), None)
    if failed is not None:
        return Evaluation(FAILED_COST, mean_metrics(list(rows)), {}, failed)
    metrics = mean_metrics(list(rows))
    alone = [mean_metrics([row]) for row in rows]

    def over(share: float | None, of: Callable[[Metrics], float]) -> float:
        return of(metrics) if share is None else exceeded([of(row) for row in alone], share)

    violations = {
        name: over(objective.breaking_share(limit), partial(_violated, name, limit, margin))
        for name, limit in objective.constraints.items()
    }
    cost = over(objective.worse_share, objective.weighted)
    cost += objective.penalty * sum(violations.values())
    return Evaluation(finite(cost), metrics, violations, "ok")


def finite(cost: float) -> float:
    """Return a cost; one that is infinite or no number is that of a gait that failed."""
    return cost if math.isfinite(cost) else FAILED_COST


def exceeded(values: Sequence[float], share: float) -> float:
    """Return the value that this share of the values exceeds."""
    with np.errstate(invalid="ignore"):  # of an infinite cost and a finite one
        return float(np.quantile(values, 1.0 - share)) if share else max(values)


def _violated(name: str, constraint: Constraint, margin: float, row: Metrics) -> float:
    value = row[name]
    if math.isnan(value):
        return _WORST_VIOLATION
    over = under = 0.0
    if constraint.max is not None:
        over = max(0.0, value - (constraint.max - margin * abs(constraint.max)))
    if constraint.min is not None:
        under = max(0.0, constraint.min + margin * abs(constraint.min) - value)
    excess = over + under
    return min(excess / constraint.scale, _WORST_VIOLATION)
