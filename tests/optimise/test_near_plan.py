"""The batch near a plan: like the planned gaits, and most of them slower."""

import numpy as np
import pytest

from gaitopt.optimise.quasi_random import near_plan, quasi_random
from gaitopt.problem.problem import Problem, load_problem


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem("arcfold")


def test_gaits_near_a_plan_have_longer_periods_inside_the_bounds(problem: Problem) -> None:
    space = problem.space
    planned = [space.decode(point) for point in quasi_random(space, 3, 5)]
    points = near_plan(space, planned, 20, 1, 0.05, 4.0)
    assert points.shape == (20, len(space.variables))
    for index, point in enumerate(points):
        from_s, to_s = planned[index % 3].period_s, space.decode(point).period_s
        assert from_s * (1 - 1e-9) <= to_s <= min(4.0 * from_s, space.period_s[1]) * (1 + 1e-9)
    longer = [space.decode(p).period_s / planned[i % 3].period_s for i, p in enumerate(points)]
    assert np.median(longer) > 1.3


def test_without_spread_only_the_period_differs(problem: Problem) -> None:
    space = problem.space
    planned = [space.decode(quasi_random(space, 1, 7)[0])]
    points = near_plan(space, planned, 8, 1, 0.0, 2.0)
    own = space.encode(planned[0])
    assert points[:, 1:] == pytest.approx(np.tile(own[1:], (8, 1)), abs=1e-9)
    assert len(np.unique(points[:, 0])) == 8
    assert np.array_equal(near_plan(space, planned, 8, 1, 0.0, 2.0), points)
    assert len(near_plan(space, planned, 0, 1, 0.0, 2.0)) == 0
