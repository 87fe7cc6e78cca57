"""The gap on held-out data: how much of it is removed, and over which blocks it is resampled."""

import numpy as np

from gaitopt.diagnose.judge.gap import resampled, shrinkage


def test_blocks_are_drawn_within_their_trial() -> None:
    groups = np.array([0, 0, 0, 1, 1])
    weights = resampled(groups, np.random.default_rng(1))
    assert (weights[:3].sum(), weights[3:].sum()) == (3.0, 2.0)


def test_shrinkage_counts_what_is_above_the_floor() -> None:
    assert shrinkage(5.0, 1.0, 1.0) == 1.0
    assert shrinkage(5.0, 3.0, 1.0) == 0.5
    assert shrinkage(1.0, 0.5, 2.0) is None
