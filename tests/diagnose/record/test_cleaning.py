"""Defects of a recording: found where they are, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from walks import FPS, GAIT, heights, recorded, steps, with_samples

from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.settings import DefectSettings, OutlierSettings
from gaitopt.diagnose.record.trial import Trial


def names(trial: Trial) -> list[str]:
    """The defects that a recording shows by itself."""
    return [defect.name for defect in clean(trial).defects]


@settings(max_examples=25)
@given(
    st.integers(0, 1000), st.sampled_from([25.0, 30.0, 50.0, 60.0, 120.0]), st.sampled_from([0.0, 3e-4, 1e-3])
)
def test_a_clean_recording_has_none(seed: int, fps: float, noise_m: float) -> None:
    trial = recorded(seed=seed, fps=fps, noise_m=noise_m)
    assert names(trial) == []


def _recurs(places: list[int]) -> bool:
    """Whether outliers are at the same phase of several cycles, like real motion."""
    cycle = round(GAIT.period_s * FPS)
    apart = [[abs((p - q + cycle // 2) % cycle - cycle // 2) for q in places if q != p] for p in places]
    return any(sum(distance <= 2 for distance in row) >= 2 for row in apart)


@given(st.lists(st.integers(5, 350), min_size=1, max_size=12, unique=True), st.sampled_from([-0.03, 0.03]))
def test_outliers_are_masked_and_nothing_else(places: list[int], shift: float) -> None:
    places = [p for p in places if all(abs(p - q) > 3 or p == q for q in places)]
    assume(not _recurs(places))
    trial = recorded()
    flags = np.isin(np.arange(len(trial.time)), places)
    cleaned = clean(with_samples(trial, flags, shift))
    if not places:
        assert cleaned.defects == ()
        return
    (defect,) = cleaned.defects
    assert defect.name == "marker_outliers"
    assert defect.masked == len(places)
    np.testing.assert_array_equal(cleaned.trial.used["marker.x"], ~flags)
    assert defect.parameters["share"] == pytest.approx(len(places) / len(flags))
    expected = abs(shift) * math.sqrt(2.0 * len(places) / len(flags))
    assert defect.error_m == pytest.approx(expected, rel=0.15)


def test_settings_say_what_an_outlier_is() -> None:
    trial = recorded()
    spoilt = with_samples(trial, np.arange(len(trial.time)) == 100, 0.02)
    assert names(spoilt) == ["marker_outliers"]
    lenient = DefectSettings(outliers=OutlierSettings(range_share=2.0))
    assert clean(spoilt, lenient).defects == ()


def test_what_recurs_in_each_cycle_is_motion() -> None:
    trial = recorded(noise_m=0.0, fps=40.0)
    phase = trial.time % GAIT.period_s
    spike = np.abs(phase - 1.2) < 0.02
    assert names(with_samples(trial, spike, 0.01)) == []
    once = spike & (trial.time < 2.0)
    assert names(with_samples(trial, once, 0.01)) == ["marker_outliers"]


def test_frozen_frames() -> None:
    trial = recorded()
    signals = {name: series.copy() for name, series in trial.signals.items()}
    begin = round(2.05 * FPS)
    for series in signals.values():
        series[begin : begin + 9] = series[begin]
    cleaned = clean(Trial.of("walk", GAIT, trial.time, signals))
    (defect,) = cleaned.defects
    assert (defect.name, defect.masked) == ("frozen_frames", 8)
    assert not cleaned.trial.used["marker.x"][begin + 1 : begin + 9].any()


def test_rest_in_a_rounded_curve_is_not_frozen() -> None:
    trial = recorded(noise_m=0.0)
    signals = {name: np.round(series, 3) for name, series in trial.signals.items()}
    assert names(Trial.of("walk", GAIT, trial.time, signals)) == []


def test_dropped_frames() -> None:
    trial = recorded()
    keep = np.ones(len(trial.time), dtype=bool)
    keep[[40, 100, 101, 102]] = False
    signals = {name: series[keep] for name, series in trial.signals.items()}
    (defect,) = clean(Trial.of("walk", GAIT, trial.time[keep], signals)).defects
    assert defect.name == "gaps"
    assert "4 frames missing in 2 gaps, the longest 0.13 s at t = 3.30 s" in defect.message


@pytest.mark.parametrize(("grid", "begin"), [(0.1, 0.0), (0.1, 5.0), (0.2, 5.0), (0.02, 0.0), (0.05, 3.0)])
def test_rounded_time_stamps_get_their_even_clock_back(grid: float, begin: float) -> None:
    trial = recorded()
    true = trial.time + 0.0037
    stamps = np.where(true >= begin, grid * np.round(true / grid), true)
    cleaned = clean(replace(trial, time=stamps))
    (defect,) = cleaned.defects
    assert defect.name == "clock_rounding"
    assert defect.parameters == {"grid_s": grid}
    assert defect.masked == 0
    assert np.abs(cleaned.trial.time - true).max() < 0.2 * grid
    assert defect.error_m > 0.0
    assert cleaned.recorded.time is stamps


@pytest.mark.parametrize("fps", [10.0, 20.0, 25.0, 50.0, 100.0])
def test_an_even_clock_is_not_rounded(fps: float) -> None:
    assert names(recorded(fps=fps)) == []


def test_time_stamps_to_the_millisecond_are_fine() -> None:
    trial = recorded()
    assert names(replace(trial, time=np.round(trial.time, 3))) == []


def test_frames_missing_from_a_clock_on_a_grid_are_no_rounding() -> None:
    trial = recorded(fps=25.0)
    keep = np.random.default_rng(1).random(len(trial.time)) < 0.8
    signals = {name: series[keep] for name, series in trial.signals.items()}
    assert names(Trial.of("walk", GAIT, trial.time[keep], signals)) == ["gaps"]


def test_rounded_stamps_with_frames_missing_are_kept_and_said() -> None:
    trial = recorded()
    keep = np.random.default_rng(1).random(len(trial.time)) < 0.5
    signals = {name: series[keep] for name, series in trial.signals.items()}
    stamps = 0.1 * np.round(trial.time[keep] / 0.1)
    cleaned = clean(Trial.of("walk", GAIT, stamps, signals))
    defect = next(defect for defect in cleaned.defects if defect.name == "clock_rounding")
    assert "±0.05 s" in defect.message
    np.testing.assert_array_equal(cleaned.trial.time, stamps)


def test_a_stepped_curve_read_off_a_plot() -> None:
    """Rounded stamps as a plot shows them: the true curve jumps at each multiple of the grid."""
    trial = recorded(fps=60.0, noise_m=0.0)
    true = np.arange(0.0, 12.0, 1.0 / 60.0)
    shown = np.where(true >= 8.0, 0.2 * np.round(true / 0.2), true)
    signals = {}
    for name, curve in (("marker.x", steps), ("marker.z", heights)):
        drawn = np.interp(trial.time, shown + 1e-6 * np.arange(len(true)), curve(true))
        signals[name] = drawn
    cleaned = clean(Trial.of("walk", GAIT, trial.time, signals))
    (defect,) = [d for d in cleaned.defects if d.name == "clock_rounding"]
    assert defect.parameters == {"grid_s": 0.2}
    assert defect.spans_s[0][0] == pytest.approx(8.0, abs=0.15)
    assert defect.masked == (~cleaned.trial.used["marker.x"]).sum() > 0


@pytest.mark.parametrize(("begin", "found"), [(7.0, ["clock_rounding"]), (10.0, [])])
def test_a_few_steps_at_even_times_are_no_evidence_of_a_rounded_clock(begin: float, found: list[str]) -> None:
    """A square wave's own edges lie on a grid, and three cells of a smooth walk may look stepped."""
    trial = recorded(fps=60.0, noise_m=0.0)
    true = np.arange(0.0, 12.0, 1.0 / 60.0)
    shown = np.where(true >= begin, 0.2 * np.round(true / 0.2), true)
    drawn = np.interp(trial.time, shown + 1e-6 * np.arange(len(true)), steps(true))
    cleaned = clean(Trial.of("walk", GAIT, trial.time, {"marker.x": drawn}))
    assert [defect.name for defect in cleaned.defects] == found


def test_noise_between_the_steps_of_a_slow_gait_is_no_stepped_curve() -> None:
    """In half a second the noise, a third of a millimetre, moves the marker as far as a creeping robot."""
    slow = replace(GAIT, period_s=4.0)
    time = np.arange(0.0, 10.0, 0.04)
    strides = 0.034 * np.clip((time[:, None] - [0.85, 4.85, 8.85]) / 0.3, 0.0, 1.0).sum(axis=1)
    slips = 0.0025 * np.clip((time[:, None] - [6.0, 7.0, 8.0]) / 0.1 + 0.5, 0.0, 1.0).sum(axis=1)
    for seed in (7, 52, 253, 254, 351):  # by chance, noise is where the half seconds are
        noise = 3.5e-4 * np.random.default_rng(seed).standard_normal(len(time))
        trial = Trial.of("walk", slow, time, {"marker.x": strides - slips + noise})
        assert not clean(trial).defects
