"""Defects that show only in comparison with the simulation: found where they are, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import FPS, GAIT, heights, recorded, simulated, steps

from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.mismatches import mismatches
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.trajectory import Trajectory


def mismatched(trial: Trial, simulation: Trajectory | None = None) -> list[Defect]:
    """The defects that a trial shows in comparison with its simulation."""
    aligned = align(trial, simulation or simulated())
    return list(mismatches(aligned, GAIT.period_s))


@settings(max_examples=25)
@given(
    st.integers(0, 1000), st.sampled_from([25.0, 30.0, 50.0, 60.0, 120.0]), st.sampled_from([0.0, 3e-4, 1e-3])
)
def test_a_clean_recording_fits_its_simulation(seed: int, fps: float, noise_m: float) -> None:
    trial = recorded(seed=seed, fps=fps, noise_m=noise_m)
    assert mismatched(trial) == []


@pytest.mark.parametrize("ratio", [0.5, 2.0, 4.0])
def test_a_wrong_frame_rate(ratio: float) -> None:
    time = np.arange(0.0, 24.0, 1.0 / 60.0)
    signals = {"marker.x": steps(time * ratio), "marker.z": heights(time * ratio)}
    (defect,) = mismatched(Trial.of("walk", GAIT, time, signals), simulated(duration=30.0))
    assert defect.name == "wrong_frame_rate"
    assert defect.parameters == {"ratio": ratio}


def test_uneven_strides_are_no_wrong_frame_rate() -> None:
    """A walk whose speed drifts repeats better every two and four cycles than every cycle."""
    found, time = [], np.arange(0.0, 10.0, 1.0 / FPS)
    for seed in range(10):
        pushed = 0.012 * np.cumsum(np.random.default_rng(seed).standard_normal(11))
        series = steps(time) + np.interp(time, np.arange(11.0), pushed)
        found += mismatched(Trial.of("walk", GAIT, time, {"marker.x": series}), simulated(duration=12.0))
    assert found == []


@pytest.mark.parametrize(("scale", "said"), [(1e3, "millimetres"), (1e2, "centimetres"), (8e3, "pixels")])
def test_a_wrong_unit(scale: float, said: str) -> None:
    trial = recorded()
    (defect,) = mismatched(replace(trial, signals={n: scale * s for n, s in trial.signals.items()}))
    assert defect.name == "wrong_unit"
    assert said in defect.message


@pytest.mark.parametrize("name", ["marker.x", "marker.z"])
def test_a_reversed_axis(name: str) -> None:
    trial = replace(recorded(), starts_at_s=0.0)
    (defect,) = mismatched(replace(trial, signals={**trial.signals, name: -trial.signals[name]}))
    assert defect.name == "axis_reversed"
    assert defect.message.startswith(name)
