"""How much the loss of a set is luck: in a fast gait, almost equal robots walk differently.

A fit is one of these robots. Another one would have left more or less of the trials, so scores that differ
no more than theirs do tell little.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.set_fit import Point
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import compared_about
from gaitopt.diagnose.judge.small_errors import almost_equal_robots
from gaitopt.simulation.rollout import Simulator


def luck(judgement: Judgement, loss: RobustLoss, point: Point, context: Context) -> float:
    """Return the standard deviation of the loss of almost equal robots; 0 where they cannot be simulated.

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
    return float(np.std([loss.total(one.whitened) for one in robots], ddof=1)) if len(robots) > 1 else 0.0
