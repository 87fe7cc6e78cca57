"""How much of the loss of a set is luck, and what that does to the probabilities of sets."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from toyfits import toy_comparison

from gaitopt import Problem
from gaitopt.diagnose.fit.robust import WideLoss
from gaitopt.diagnose.judge.evidence import averaged
from gaitopt.diagnose.judge.luck import luck
from gaitopt.diagnose.judge.settings import DEFAULT
from gaitopt.diagnose.judge.small_errors import almost_equal_robots
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

EACH = 30
LOSS = WideLoss(np.repeat([0, 1], EACH), 4.0, 3.0, 10.0, np.ones(2), np.ones(2))
"""Of two trials; each counts as ten rows."""


def whitened(steady: float, jumping: float) -> Array:
    """Residuals with these mean squares in the two trials."""
    return np.sqrt(np.repeat([steady, jumping], EACH))


def test_almost_equal_robots_differ_in_their_start_pose_and_half_of_them_in_their_timestep(
    strider: Problem,
) -> None:
    simulator = Simulator.build(strider)
    robots, again = (almost_equal_robots(simulator, 1, 4, 0.1) for _ in range(2))
    scenarios = [robot.scenarios[0] for robot in robots]
    assert scenarios == [robot.scenarios[0] for robot in again]
    assert len({one.pose_seed for one in scenarios}) == 4
    assert {one.start_pose_rad for one in scenarios} == {0.1 * strider.file.tolerances.start_pose_rad}
    steps = np.array([robot.fidelity.timestep_s for robot in robots])
    np.testing.assert_allclose(steps / simulator.fidelity.timestep_s, [1.0, 0.5, 1.0, 0.5])


@pytest.mark.parametrize(("left", "luck_of"), [([0.5, 0.9, 0.1], 0.4 * 10.0), ([0.5], 0.0)])
def test_luck_is_how_much_the_losses_of_almost_equal_robots_differ(
    strider: Problem, left: list[float], luck_of: float
) -> None:
    """The first robot is the one about which the others are drawn; one alone says nothing."""
    found = [toy_comparison([], whitened(0.7, one)) for one in (0.3, *left)]
    context: Any = SimpleNamespace(
        settings=DEFAULT, seed=1, runner=SimpleNamespace(compare_robots=lambda trial_set, robots: found)
    )
    trial_set: Any = SimpleNamespace(
        problem=strider, simulator=Simulator.build(strider), row_blocks=np.zeros(2 * EACH)
    )
    judgement: Any = SimpleNamespace(trial_set=trial_set)
    assert luck(judgement, LOSS, [], context) == pytest.approx(luck_of)


def test_scores_that_differ_less_than_luck_say_little() -> None:
    """Of two sets that are 5 apart the second one is improbable without luck; with much of it, it is not."""
    sure = np.exp(averaged(np.array([-40.0, -45.0, -90.0]), 0.0, 1))
    np.testing.assert_allclose(sure, np.exp([0.0, -5.0, -50.0]) / (1.0 + np.exp(-5.0)), rtol=1e-12)
    doubtful = np.exp(averaged(np.array([-40.0, -45.0, -90.0]), 8.0, 1))
    assert doubtful.sum() == pytest.approx(1.0)
    assert 0.25 < doubtful[1] < 0.4
    assert doubtful[2] < 1e-3, "far more than luck"


def test_luck_prefers_neither_small_sets_nor_large_ones() -> None:
    both = np.exp(averaged(np.array([-40.0, -40.0]), 6.0, 3))
    np.testing.assert_allclose(both, 0.5, atol=0.02)


def test_luck_is_the_same_for_the_same_seed() -> None:
    scores = np.array([-1.0, -3.0])
    np.testing.assert_array_equal(averaged(scores, 2.0, 5), averaged(scores, 2.0, 5))
    assert not np.array_equal(averaged(scores, 2.0, 5), averaged(scores, 2.0, 6))
