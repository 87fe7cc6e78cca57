"""How much the loss of a set jumps by chance, and how little such a trial then counts."""

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from toyfits import toy_comparison

from gaitopt import Problem
from gaitopt.diagnose.fit.robust import WideLoss
from gaitopt.diagnose.judge.jumps import loss_jumps
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


@pytest.mark.parametrize(
    ("left", "jumps"), [([0.5, 0.9, 0.1], [0.0, 0.4 * 10.0 * 2**0.5]), ([0.5], [0.0, 0.0])]
)
def test_a_loss_jumps_as_far_as_those_of_two_almost_equal_robots_differ(
    strider: Problem, left: list[float], jumps: list[float]
) -> None:
    """The first robot is the one about which the others are drawn; one alone says nothing."""
    found = [toy_comparison([], whitened(0.7, one)) for one in (0.3, *left)]
    context: Any = SimpleNamespace(
        settings=DEFAULT, seed=1, runner=SimpleNamespace(compare_robots=lambda trial_set, robots: found)
    )
    trial_set: Any = SimpleNamespace(
        problem=strider, simulator=Simulator.build(strider), row_blocks=np.zeros(2 * EACH), n_trials=2
    )
    judgement: Any = SimpleNamespace(trial_set=trial_set)
    np.testing.assert_allclose(loss_jumps(judgement, LOSS, [], context), jumps, atol=1e-12)


@pytest.mark.parametrize(("no_evidence", "better"), [([0.0, 0.0], "lucky"), ([0.0, 4.0], "right")])
def test_what_a_set_gains_where_almost_equal_robots_differ_is_weak_evidence(
    no_evidence: list[float], better: str
) -> None:
    fits = {"lucky": whitened(0.9, 0.2), "right": whitened(0.7, 0.6)}
    minus_log = import_module("gaitopt.diagnose.judge.gait_sets")._minus_log
    judge: Any = SimpleNamespace(
        loss=LOSS, fitter=SimpleNamespace(score=lambda fit: LOSS.total(fit.robot.whitened))
    )
    scores = {
        name: minus_log(
            judge,
            SimpleNamespace(hypotheses=(), robot=SimpleNamespace(whitened=one)),
            np.array(no_evidence),
        )
        for name, one in fits.items()
    }
    assert min(scores, key=lambda name: scores[name]) == better
