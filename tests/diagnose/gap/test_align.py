"""Trials aligned with their predictions."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from walks import GAIT, wave

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.align import align, pooled_marker_rms
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.trajectory import Trajectory

Diagnosed = Callable[..., Diagnosis]


@pytest.mark.parametrize("begin", [-0.6, 0.7])
def test_an_unknown_offset_is_fitted(diagnosed: Diagnosed, begin: float) -> None:
    diagnosis = diagnosed(begin=begin, sync=False)
    assert diagnosis.verdict == "no_gap"
    for trial in diagnosis.trials:
        assert trial.aligned.offset_s == pytest.approx(begin, abs=0.005)


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
