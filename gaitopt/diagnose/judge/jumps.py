"""How much the loss of a set jumps by chance: in a fast gait, almost equal robots walk differently.

A fit is one of these robots, and a search picks the luckiest of many. So what it gains in such a gait is
weaker evidence than what it gains in a slow one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.set_fit import Point
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import compared_about
from gaitopt.diagnose.judge.small_errors import almost_equal_robots
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]


def loss_jumps(judgement: Judgement, loss: RobustLoss, point: Point, context: Context) -> Array:
    """Return by how much the losses of almost equal robots differ by chance, shape (trials,).

    Args:
        judgement: the trials.
        loss: the loss of a whitened residual.
        point: effects of these robots, each at its coordinate.
        context: simulates robots.
    """
    settings = context.settings.small_errors

    def draw(centre: Simulator) -> Sequence[Simulator]:
        return almost_equal_robots(centre, context.seed, settings.almost_equal, settings.almost)

    effects = robot_request(point).effects
    robots = compared_about(judgement.trial_set, effects, "almost equal or finer", draw, context).comparisons
    if len(robots) < 2:
        return np.zeros(judgement.trial_set.n_trials)
    losses = np.array([loss.of_squares(loss.squares(one.whitened)) for one in robots])
    jumps: Array = math.sqrt(2.0) * losses.std(axis=0, ddof=1)
    return jumps
