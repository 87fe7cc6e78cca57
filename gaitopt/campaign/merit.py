"""What the searches of a campaign look for: gaits that are fast, and probably go straight enough.

A limit on the drift is no wall here. Robots predict the drift of a gait only roughly, and a penalty that is
right for a fast robot is larger than any speed of a slow one. So what a gait earns counts with the chance
that its film keeps the limit, as it does when the next film is chosen (J. R. Gardner et al., "Bayesian
Optimization with Inequality Constraints", ICML 2014).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaitopt.campaign.course import most_drift, within
from gaitopt.optimise.evaluator import Outcome, judge
from gaitopt.problem.objective import Objective
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SIDEWAYS_RATIO, Metrics, mean_metrics
from gaitopt.simulation.objective import Evaluation, exceeded, finite


def merit(problem: Problem, outcomes: Sequence[Outcome], margin: float, error: float) -> Evaluation:
    """Return the evaluation of a gait in which its terms count with the probability that it goes straight.

    Args:
        problem: the problem. Its other limits are judged as it says, by their penalty.
        outcomes: the gait on each robot.
        margin: share by which the other limits are tightened.
        error: standard deviation of what a predicted drift, sideways over forward travel, is off.
    """
    judged, objective, limit = judge(problem, outcomes, margin), problem.objective, most_drift(problem)
    if judged.status != "ok" or not math.isfinite(limit):
        return judged
    costs = [_cost(objective, one.metrics, limit, error) for one in outcomes]
    worse = objective.worse_share
    cost = float(np.mean(costs)) if worse is None else exceeded(costs, worse)
    violations = _others(judged)
    cost += objective.penalty * sum(violations.values())
    return replace(judged, cost=finite(cost), violations=violations)


def merit_of_means(problem: Problem, evaluation: Evaluation, error: float) -> float:
    """Return nearly the same cost where only the means over the robots are known; lower is better.

    Args:
        problem: the problem.
        evaluation: the gait, over all robots.
        error: standard deviation of what a predicted drift, sideways over forward travel, is off.
    """
    objective, limit = problem.objective, most_drift(problem)
    if evaluation.status != "ok" or not math.isfinite(limit):
        return evaluation.cost
    broken = sum(_others(evaluation).values())
    return _cost(objective, evaluation.metrics, limit, error) + objective.penalty * broken


def _others(evaluation: Evaluation) -> dict[str, float]:
    """Return the violations without that of the limit on the drift: what breaks it counts by its chance."""
    return evaluation.violations | {SIDEWAYS_RATIO: 0.0}


def _cost(objective: Objective, row: Metrics, limit: float, error: float) -> float:
    """Return the weighted sum of the metrics; what it earns counts with the probability of going straight."""
    cost = objective.weighted(mean_metrics([row]))
    return cost * float(within(row[SIDEWAYS_RATIO], limit, error)) if cost < 0.0 else cost
