"""The gap on held-out data: how much of it is removed, and over which blocks it is resampled."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gaitopt.diagnose.judge.gap import GapMeter, resampled, shrinkage


def test_blocks_are_drawn_within_their_trial() -> None:
    groups = np.array([0, 0, 0, 1, 1])
    weights = resampled(groups, np.random.default_rng(1))
    assert (weights[:3].sum(), weights[3:].sum()) == (3.0, 2.0)


def test_shrinkage_counts_what_is_above_the_floor() -> None:
    assert shrinkage(5.0, 1.0, 1.0) == 1.0
    assert shrinkage(5.0, 3.0, 1.0) == 0.5
    assert shrinkage(1.0, 0.5, 2.0) is None


@pytest.mark.parametrize("axes", [("marker.x", "marker.y"), ("marker.x",)])
def test_the_marker_is_as_far_off_whatever_another_trial_measured(axes: tuple[str, ...]) -> None:
    """The distance of a trial is over its own axes: the first trial has angles alone."""
    rows = [{"joint.bend": range(4)}, dict.fromkeys(axes, range(4))]
    samples = 4 * len(axes)
    trial_set: Any = SimpleNamespace(
        trials=[SimpleNamespace(bins=SimpleNamespace(rows=own)) for own in rows],
        block_trials=np.array([0, 1]),
        sample_blocks=np.full(samples, 1),
        n_blocks=2,
    )
    off: Any = SimpleNamespace(marker=np.full(samples, 0.003))
    gap = GapMeter(trial_set, off, seed=1, draws=3).measure(off, 0.001)
    assert gap.before == pytest.approx(0.003 * np.sqrt(len(axes)))
