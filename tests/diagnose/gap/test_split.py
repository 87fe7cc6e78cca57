"""Components of a gap: changes of made-up motion are assigned to the right component."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walks import GAIT, wave

from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.split import Split, split
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.trajectory import Trajectory


def made_up(**changes: float) -> Split:
    """The gap of a walk that differs from its simulation by some changes of `wave`."""
    time = np.arange(0.0, 20.0, 0.02)
    trial = Trial.of("walk", GAIT, time, {"marker.x": wave(time, **changes)})
    fine = np.arange(-1.0, 25.0, 1e-3)
    aligned = align(
        Trial(trial.name, trial.drive, trial.time, trial.signals, trial.used, starts_at_s=0.0),
        Trajectory(fine, {"marker.x": wave(fine)}),
    )
    return split(aligned, "marker.x", 2.0, {})


@given(st.floats(0.6, 1.5), st.floats(-0.01, 0.01), st.floats(-0.2, 0.2))
def test_size_drift_and_delay_are_recovered(size: float, drift: float, delay: float) -> None:
    part = made_up(size=size, drift=drift, delay=delay)
    assert part.size == pytest.approx(size, abs=0.01)
    assert part.delay_s == pytest.approx(delay, abs=0.01)
    assert part.travel is not None
    assert part.travel[0] == pytest.approx(0.02 * size + drift, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "component"),
    [({"size": 0.8}, "stride"), ({"drift": -0.004}, "drift"), ({"delay": 0.1}, "timing")],
)
def test_pure_changes_have_one_component(change: dict[str, float], component: str) -> None:
    part = made_up(**change)
    assert part.squares[component] / part.rms**2 > 0.98
