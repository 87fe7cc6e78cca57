"""Trials aligned with their predictions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from responses import Servo, commands, recorded
from walks import GAIT, wave

from gaitopt.core.streams import seeded
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.align import align, longest_offset, pooled_marker_rms
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.trajectory import Trajectory

Diagnosed = Callable[..., Diagnosis]


@pytest.mark.parametrize("begin", [-0.6, 0.7])
def test_an_unknown_offset_is_fitted(diagnosed: Diagnosed, begin: float) -> None:
    diagnosis = diagnosed(begin=begin, sync=False)
    assert diagnosis.verdict == "no_gap"
    for trial in diagnosis.trials:
        assert trial.aligned.offset_s == pytest.approx(begin, abs=0.005)


def test_a_joint_tells_the_start_where_the_marker_drifts_to_one_side() -> None:
    """The robot rests before the gait begins; one cycle later only that first moment differs.

    A marker that drifts otherwise than simulated has a larger error than a joint, so it tells less.
    """

    def joint(time: np.ndarray) -> np.ndarray:
        return np.where(time < 0.0, 0.0, np.abs(np.sin(np.pi * time / GAIT.period_s)))

    def aside(time: np.ndarray) -> np.ndarray:
        return 0.05 * np.sin(0.9 * time)

    fine, time, begin = np.arange(0.0, 12.0, 1e-3), np.arange(0.0, 8.0, 0.02), -0.24
    simulated = Trajectory(fine, {"marker.y": aside(fine), "joint.knee": joint(fine)})
    other = aside(time + begin + GAIT.period_s) + 0.02 * np.sin(2.0 * time)
    measured = {"marker.y": other, "joint.knee": joint(time + begin)}
    noisy = {name: series + 1e-3 * seeded(4).standard_normal(len(time)) for name, series in measured.items()}
    aligned = align(Trial.of("walk", GAIT, time, noisy), simulated)
    assert aligned.offset_s == pytest.approx(begin, abs=0.01)


def test_trials_are_pooled_by_samples() -> None:
    time = np.arange(0.0, 8.0, 0.02)
    fine = Trajectory(np.arange(0.0, 12.0, 1e-3), {"marker.x": wave(np.arange(0.0, 12.0, 1e-3))})
    rng = np.random.default_rng(1)
    trials = []
    for count, noise in ((len(time), 1e-3), (len(time) // 2, 4e-3)):
        series = wave(time[:count]) + noise * rng.standard_normal(count)
        trial = Trial.of("walk", GAIT, time[:count], {"marker.x": series})
        trials.append(align(trial, fine))
    residuals = np.concatenate([aligned.residual["marker.x"] for aligned in trials])
    assert pooled_marker_rms(trials) == pytest.approx(math.sqrt(np.mean(residuals**2)))


@pytest.mark.parametrize(
    ("kind", "offset"),
    [
        ("step", -0.4),  # later than the step there would be nothing to see
        ("ramp", 0.9),
        ("square", -1.3),
        ("square", 0.9),
        ("telegraph", -1.3),
        ("telegraph", 0.0),
        ("chirp", 0.9),
        ("triangle", -0.4),
    ],
)
def test_the_clock_of_a_log_may_be_far_from_that_of_the_recording(kind: str, offset: float) -> None:
    """Recording and log have clocks of their own, and the servo is another one than simulated."""
    drive = replace(commands(kind, 0.8, 4.0), block_s=0.25)
    measured = Servo(hz=6.0, damping=0.6).follow(drive, 7.0)
    trial = recorded(measured, drive, 4.0, lambda time, response: response(time + offset))
    unknown = replace(trial, starts_at_s=None)
    assert longest_offset(unknown) == pytest.approx(2.0, abs=0.02)
    aligned = align(unknown, Servo().follow(drive, 7.0))
    assert aligned.offset_s == pytest.approx(offset, abs=0.04)


def test_a_short_recording_of_a_log_is_searched_over_half_its_length() -> None:
    drive = commands("step", 0.16, 0.24)
    trial = replace(recorded(Servo().follow(drive, 0.5), drive, 0.24), starts_at_s=None)
    assert longest_offset(trial) == pytest.approx(0.11)
