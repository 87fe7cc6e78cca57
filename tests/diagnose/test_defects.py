"""Defects of a recording: found where they are, and only there."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.mismatches import mismatches
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.noise import noise_of
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Channel, Gait
from gaitopt.robot.trajectory import Trajectory

GAIT = Gait(2.0, {"servo": Channel(duty=0.5, phase=0.0, amplitude_deg=30.0)}, "wave")
FPS = 30.0


def steps(time):
    """Strides of 30 mm in a quarter of a 2 s cycle, and a little slip back."""
    turns = time / GAIT.period_s
    push = np.clip((turns % 1.0) / 0.25, 0.0, 1.0)
    return 0.03 * (np.floor(turns) + 0.5 - 0.5 * np.cos(np.pi * push)) - 0.004 * (turns % 1.0)


def heights(time):
    """A hump of 10 mm in each cycle."""
    return 0.01 * np.maximum(0.0, np.sin(2.0 * np.pi * time / GAIT.period_s))


def recorded(duration=12.0, fps=FPS, noise_m=3e-4, seed=1):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1.0 / fps)
    signals = {
        "marker.x": steps(time) + noise_m * rng.standard_normal(len(time)),
        "marker.z": heights(time) + noise_m * rng.standard_normal(len(time)),
    }
    return Trial.of("walk", GAIT, time, signals)


def with_samples(trial, flags, shift):
    signals = {name: np.where(flags, series + shift, series) for name, series in trial.signals.items()}
    return Trial.of(trial.name, trial.drive, trial.time, signals)


def names(trial):
    return [defect.name for defect in clean(trial).defects]


def simulated(x=steps, z=heights, duration=16.0):
    time = np.arange(0.0, duration, 1e-3)
    return Trajectory(time, {"marker.x": x(time), "marker.z": z(time)})


def mismatched(trial, simulation=None):
    aligned = align(trial, simulation or simulated())
    return list(mismatches(aligned, GAIT.period_s))


@settings(max_examples=25)
@given(
    st.integers(0, 1000), st.sampled_from([25.0, 30.0, 50.0, 60.0, 120.0]), st.sampled_from([0.0, 3e-4, 1e-3])
)
def test_a_clean_recording_has_none(seed, fps, noise_m):
    trial = recorded(seed=seed, fps=fps, noise_m=noise_m)
    assert names(trial) == []
    assert mismatched(trial) == []


def _recurs(places: list[int]) -> bool:
    """Whether outliers stand at the same phase of several cycles, as motion does."""
    cycle = round(GAIT.period_s * FPS)
    apart = [[abs((p - q + cycle // 2) % cycle - cycle // 2) for q in places if q != p] for p in places]
    return any(sum(distance <= 2 for distance in row) >= 2 for row in apart)


@given(st.lists(st.integers(5, 350), min_size=1, max_size=12, unique=True), st.sampled_from([-0.03, 0.03]))
def test_outliers_are_masked_and_nothing_else(places, shift):
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


def test_what_recurs_in_each_cycle_is_motion():
    trial = recorded(noise_m=0.0, fps=40.0)
    phase = trial.time % GAIT.period_s
    spike = np.abs(phase - 1.2) < 0.02
    assert names(with_samples(trial, spike, 0.01)) == []
    once = spike & (trial.time < 2.0)
    assert names(with_samples(trial, once, 0.01)) == ["marker_outliers"]


def test_frozen_frames():
    trial = recorded()
    signals = {name: series.copy() for name, series in trial.signals.items()}
    begin = round(2.05 * FPS)
    for series in signals.values():
        series[begin : begin + 9] = series[begin]
    cleaned = clean(Trial.of("walk", GAIT, trial.time, signals))
    (defect,) = cleaned.defects
    assert (defect.name, defect.masked) == ("frozen_frames", 8)
    assert not cleaned.trial.used["marker.x"][begin + 1 : begin + 9].any()


def test_rest_in_a_rounded_curve_is_not_frozen():
    trial = recorded(noise_m=0.0)
    signals = {name: np.round(series, 3) for name, series in trial.signals.items()}
    assert names(Trial.of("walk", GAIT, trial.time, signals)) == []


def test_dropped_frames():
    trial = recorded()
    keep = np.ones(len(trial.time), dtype=bool)
    keep[[40, 100, 101, 102]] = False
    signals = {name: series[keep] for name, series in trial.signals.items()}
    (defect,) = clean(Trial.of("walk", GAIT, trial.time[keep], signals)).defects
    assert defect.name == "gaps"
    assert "4 frames missing in 2 gaps, the longest 0.13 s at t = 3.30 s" in defect.message


@pytest.mark.parametrize(("grid", "begin"), [(0.1, 0.0), (0.1, 5.0), (0.2, 5.0), (0.02, 0.0), (0.05, 3.0)])
def test_rounded_time_stamps_get_their_even_clock_back(grid, begin):
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
def test_an_even_clock_is_not_rounded(fps):
    assert names(recorded(fps=fps)) == []


def test_time_stamps_to_the_millisecond_are_fine():
    trial = recorded()
    assert names(replace(trial, time=np.round(trial.time, 3))) == []


def test_frames_missing_from_a_clock_on_a_grid_are_no_rounding():
    trial = recorded(fps=25.0)
    keep = np.random.default_rng(1).random(len(trial.time)) < 0.8
    signals = {name: series[keep] for name, series in trial.signals.items()}
    assert names(Trial.of("walk", GAIT, trial.time[keep], signals)) == ["gaps"]


def test_rounded_stamps_with_frames_missing_are_kept_and_said():
    trial = recorded()
    keep = np.random.default_rng(1).random(len(trial.time)) < 0.5
    signals = {name: series[keep] for name, series in trial.signals.items()}
    stamps = 0.1 * np.round(trial.time[keep] / 0.1)
    cleaned = clean(Trial.of("walk", GAIT, stamps, signals))
    defect = next(defect for defect in cleaned.defects if defect.name == "clock_rounding")
    assert "±0.05 s" in defect.message
    np.testing.assert_array_equal(cleaned.trial.time, stamps)


def test_a_stepped_curve_read_off_a_plot():
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


@pytest.mark.parametrize("ratio", [0.5, 2.0, 4.0])
def test_a_wrong_frame_rate(ratio):
    time = np.arange(0.0, 24.0, 1.0 / 60.0)
    signals = {"marker.x": steps(time * ratio), "marker.z": heights(time * ratio)}
    (defect,) = mismatched(Trial.of("walk", GAIT, time, signals), simulated(duration=30.0))
    assert defect.name == "wrong_frame_rate"
    assert defect.parameters == {"ratio": ratio}


def test_uneven_strides_are_no_wrong_frame_rate():
    """A walk whose speed wanders repeats by twos and fours better than one by one."""
    found, time = [], np.arange(0.0, 10.0, 1.0 / FPS)
    for seed in range(10):
        pushed = 0.012 * np.cumsum(np.random.default_rng(seed).standard_normal(11))
        series = steps(time) + np.interp(time, np.arange(11.0), pushed)
        found += mismatched(Trial.of("walk", GAIT, time, {"marker.x": series}), simulated(duration=12.0))
    assert found == []


@pytest.mark.parametrize(("scale", "said"), [(1e3, "millimetres"), (1e2, "centimetres"), (8e3, "pixels")])
def test_a_wrong_unit(scale, said):
    trial = recorded()
    (defect,) = mismatched(replace(trial, signals={n: scale * s for n, s in trial.signals.items()}))
    assert defect.name == "wrong_unit"
    assert said in defect.message


@pytest.mark.parametrize("name", ["marker.x", "marker.z"])
def test_a_reversed_axis(name):
    trial = replace(recorded(), starts_at_s=0.0)
    (defect,) = mismatched(replace(trial, signals=trial.signals | {name: -trial.signals[name]}))
    assert defect.name == "axis_reversed"
    assert defect.message.startswith(name)


@given(st.floats(1e-5, 1e-2), st.integers(0, 100))
def test_noise_is_estimated_under_motion(noise, seed):
    time = np.arange(0.0, 20.0, 1.0 / FPS)
    series = 100.0 * noise * time + noise * np.random.default_rng(seed).standard_normal(len(time))
    assert noise_of(series) == pytest.approx(noise, rel=0.25)


@pytest.mark.parametrize(("begin", "found"), [(7.0, ["clock_rounding"]), (10.0, [])])
def test_a_few_steps_at_even_times_are_no_evidence_of_a_rounded_clock(begin, found):
    """A square wave's own edges lie on a grid, and three cells of a smooth walk may look stepped."""
    trial = recorded(fps=60.0, noise_m=0.0)
    true = np.arange(0.0, 12.0, 1.0 / 60.0)
    shown = np.where(true >= begin, 0.2 * np.round(true / 0.2), true)
    drawn = np.interp(trial.time, shown + 1e-6 * np.arange(len(true)), steps(true))
    cleaned = clean(Trial.of("walk", GAIT, trial.time, {"marker.x": drawn}))
    assert [defect.name for defect in cleaned.defects] == found


def test_noise_between_the_steps_of_a_slow_gait_is_no_stepped_curve():
    """A third of a millimetre of noise goes as far in half a second as a robot creeps in it."""
    slow = replace(GAIT, period_s=4.0)
    time = np.arange(0.0, 10.0, 0.04)
    strides = 0.034 * np.clip((time[:, None] - [0.85, 4.85, 8.85]) / 0.3, 0.0, 1.0).sum(axis=1)
    slips = 0.0025 * np.clip((time[:, None] - [6.0, 7.0, 8.0]) / 0.1 + 0.5, 0.0, 1.0).sum(axis=1)
    for seed in (7, 52, 253, 254, 351):  # by chance, noise is where the half seconds are
        noise = 3.5e-4 * np.random.default_rng(seed).standard_normal(len(time))
        trial = Trial.of("walk", slow, time, {"marker.x": strides - slips + noise})
        assert not clean(trial).defects
