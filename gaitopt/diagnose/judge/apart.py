"""How far two robots are apart in some trials."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.robot.signals import is_position

Apart = Callable[[TrialSet, Comparison, Comparison], float]
"""Tells how far two robots are apart: at 2 the difference shows."""

_ANGLE_FLOORS = 3.0
"""Floors of an angle that count as one: nearly each effect of a servo is seen in it, however small."""


def squares_apart(trial_set: TrialSet, one: Comparison, other: Comparison) -> float:
    """Return the mean whitened square of the difference of two robots, in the trial where it is most."""
    return float(trial_set.mean_squares(one.whitened - other.whitened).max())


def floors_apart(trial_set: TrialSet, one: Comparison, other: Comparison, floors: Sequence[Floors]) -> float:
    """Return how far two robots are apart, in floors, in the trial and signal where it is most.

    Args:
        trial_set: the trials.
        one, other: the trials compared with the robots.
        floors: floor of each signal of each trial.
    """
    ratios = [0.0]
    for kind, residuals, blocks in (
        (True, one.marker - other.marker, trial_set.sample_blocks),
        (False, one.angles - other.angles, trial_set.angle_blocks),
    ):
        trials = trial_set.block_trials[blocks]
        for index, own in enumerate(floors):
            squares = [floor.total**2 for name, floor in own.items() if is_position(name) == kind]
            moved = residuals[trials == index]
            if squares and len(moved):
                floor = math.sqrt(float(np.mean(squares))) * (1.0 if kind else _ANGLE_FLOORS)
                ratios.append(math.sqrt(float(np.mean(moved**2))) / max(floor, 1e-12))
    return max(ratios)
