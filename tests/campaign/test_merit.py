"""A gait earns what its objective says, with the probability that it goes straight enough."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from outcomes import FAST, LIMITS, looking_for, walk

from gaitopt.campaign.merit import merit
from gaitopt.optimise.evaluator import Outcome, judge
from gaitopt.problem.objective import Quantile
from gaitopt.problem.problem import Problem
from gaitopt.simulation.objective import FAILED_COST

ERROR = 0.075
PROBLEM = looking_for(FAST)


def cost(*walks: Outcome, problem: Problem = PROBLEM, error: float = ERROR) -> float:
    return merit(problem, walks, 0.0, error).cost


def test_a_drift_that_is_known_exactly_is_a_wall() -> None:
    assert cost(walk(0.05, 0.09), error=1e-9) == pytest.approx(-0.05)
    assert cost(walk(0.05, 0.11), error=1e-9) == pytest.approx(0.0)


def test_at_the_limit_half_the_speed_counts() -> None:
    assert cost(walk(0.05, 0.1)) == pytest.approx(-0.025, rel=0.01)


@given(st.floats(1e-3, 0.2), st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_a_gait_that_goes_forward_is_never_worse_than_standing(
    speed: float, less: float, more: float
) -> None:
    """Whatever it drifts, and a straighter one is never worse: there is a slope to follow."""
    less, more = sorted((less, more))
    assert cost(walk(speed, less)) <= cost(walk(speed, more)) <= 0.0 == cost(walk(0.0, 10.0))


def test_going_backward_straight_earns_nothing() -> None:
    assert cost(walk(-0.05, 0.0)) == pytest.approx(0.05)
    assert cost(walk(-0.05, 5.0)) == pytest.approx(0.05)


def test_each_robot_counts_with_its_own_drift() -> None:
    straight, aside = walk(0.05, 0.0), walk(0.07, 0.5)
    assert cost(straight, aside) == pytest.approx(0.5 * (cost(straight) + cost(aside)))
    worst = looking_for(FAST.model_copy(update={"over_scenarios": Quantile(quantile=0.0)}))
    assert cost(straight, aside, problem=worst) == pytest.approx(cost(aside))


def test_other_limits_keep_their_penalty() -> None:
    assert cost(walk(0.05, 0.0, tilt=0.7)) == pytest.approx(cost(walk(0.05, 0.0)) + 2.0 * FAST.penalty)


def test_without_a_limit_on_the_drift_the_objective_judges() -> None:
    free = looking_for(FAST.model_copy(update={"constraints": {"tilt_rad": LIMITS["tilt_rad"]}}))
    walks = [walk(0.05, 0.9, tilt=0.6)]
    assert merit(free, walks, 0.0, ERROR) == judge(free, walks)


def test_drifts_to_both_sides_cost_the_same() -> None:
    """Terms on a signed drift weigh its size, as the objective does."""
    aside = looking_for(FAST.model_copy(update={"terms": {"speed_m_s": -1.0, "sideways_m_s": 1.0}}))

    def drifting(sideways: float) -> Outcome:
        return replace(walk(0.05, 0.05), metrics={**walk(0.05, 0.05).metrics, "sideways_m_s": sideways})

    assert cost(drifting(0.01), problem=aside) == cost(drifting(-0.01), problem=aside)
    assert cost(drifting(0.01), problem=aside) > cost(drifting(0.0), problem=aside)


def test_a_metric_that_is_infinite_counts_as_failed() -> None:
    """A robot that goes nowhere has an infinite cost of transport; the journal holds finite costs."""
    cheap = looking_for(FAST.model_copy(update={"terms": {"cost_of_transport": 1.0}}))
    still = replace(walk(0.0, 0.0), metrics={**walk(0.0, 0.0).metrics, "cost_of_transport": math.inf})
    assert cost(still, problem=cheap) == FAILED_COST


def test_a_robot_that_cannot_be_simulated_counts_as_failed() -> None:
    walks = [walk(0.05, 0.0), walk(0.05, 0.0, status="diverged")]
    assert merit(PROBLEM, walks, 0.0, ERROR) == judge(PROBLEM, walks)
