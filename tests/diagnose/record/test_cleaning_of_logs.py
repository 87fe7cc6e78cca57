"""Defects of logs: lost samples, doubled stamps, wrapped, stuck and coarse angles; none in clean logs."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from servologs import COUNT, followed, log, recording, targets
from walks import GAIT, recorded

from gaitopt.diagnose.record.angles import TURN
from gaitopt.diagnose.record.cleaning import Cleaned, clean
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import import_file
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.logged import LoggedCommands

BENCH = Path(os.environ.get("GAITOPT_BENCH_DATA", Path(__file__).parents[4] / "shared/data/servo-bench"))


def names(trial: Trial) -> list[str]:
    """The defects that a recording shows by itself."""
    return [defect.name for defect in clean(trial).defects]


def with_angle(trial: Trial, angle: Series) -> Trial:
    """The same log with another angle."""
    return replace(trial, signals={"joint.arm": angle}, used={"joint.arm": np.isfinite(angle)})


def only(cleaned: Cleaned) -> tuple[str, str]:
    """Name and message of the only defect."""
    (defect,) = cleaned.defects
    return defect.name, defect.message


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 1000),
    st.sampled_from([20.0, 50.0, 100.0, 240.0]),
    st.sampled_from([0.0, COUNT, 0.001]),
    st.sampled_from([0.3, 1.2]),
)
def test_a_clean_log_has_none(seed: int, rate_hz: float, step_rad: float, size: float) -> None:
    assert names(log(rate_hz=rate_hz, step_rad=step_rad, seed=seed, size=size)) == []


@pytest.mark.parametrize("rate_hz", [10.0, 50.0])
def test_rest_between_sudden_steps_is_clean(rate_hz: float) -> None:
    """Sampled slowly, a servo at rest seems to jump."""
    time = np.arange(0.0, 6.0, 1.0 / rate_hz)
    commanded = np.where(time % 2.0 < 1.0, -0.6, 0.6)
    angle = np.round(followed(time, commanded, lag_s=0.02) / COUNT) * COUNT
    assert names(recording(time, commanded, angle)) == []


def test_a_joint_at_rest_is_clean() -> None:
    """One that is not asked to move, and whose encoder goes to and fro by a count."""
    trial = log()
    still = COUNT * np.random.default_rng(1).integers(0, 2, len(trial.time))
    assert names(with_angle(trial, still)) == []
    drive = LoggedCommands.of(["servo"], trial.time, np.zeros((len(trial.time), 1)))
    assert names(replace(with_angle(trial, np.zeros(len(trial.time))), drive=drive)) == []


@pytest.mark.skipif(not BENCH.is_dir(), reason=f"no real servo in {BENCH} (GAITOPT_BENCH_DATA)")
def test_the_real_servo_has_no_defect_but_its_encoders_steps() -> None:
    mapping = ImportOptions(commands={"servo": "target_rad"}, signals={"joint.arm": "angle_rad"})
    files = sorted(BENCH.glob("*.csv"))
    assert len(files) >= 40
    for path in files:
        found = [defect.name for defect in import_file(path, mapping).defects]
        assert found == (["coarse_angles"] if path.stem.startswith("step-3deg-down") else []), path


def test_lost_samples_are_called_so() -> None:
    trial = log()
    keep = np.ones(len(trial.time), dtype=bool)
    keep[[50, 120, 121]] = False
    name, message = only(
        clean(recording(trial.time[keep], np.zeros(keep.sum()), trial.signals["joint.arm"][keep]))
    )
    assert name == "gaps"
    assert message == "3 samples lost in 2 gaps, the longest 0.06 s at t = 2.38 s"


def test_of_doubled_stamps_the_last_sample_counts() -> None:
    trial = log()
    time = trial.time.copy()
    time[[30, 80]] = time[[31, 81]]
    cleaned = clean(replace(trial, time=time))
    (defect,) = cleaned.defects
    assert (defect.name, defect.masked) == ("doubled_stamps", 2)
    assert "2 time stamps doubled, the first at t = 0.62 s" in defect.message
    np.testing.assert_array_equal(np.flatnonzero(~cleaned.trial.used["joint.arm"]), [30, 80])


def test_a_curve_read_off_a_plot_may_share_stamps() -> None:
    trial = recorded()
    time = trial.time.copy()
    time[30] = time[31]
    assert names(replace(trial, time=time)) == ["gaps"]


@pytest.mark.parametrize("low", [0.0, -math.pi, math.pi / 2.0])
@pytest.mark.parametrize("step_rad", [0.0, COUNT])
def test_wrapped_angles_are_unwrapped(low: float, step_rad: float) -> None:
    """A sensor of one turn that begins anywhere; the motion goes over its end."""
    trial = log(step_rad=step_rad, size=1.2)
    true = trial.signals["joint.arm"] + (low if low else 0.0)
    wrapped = np.mod(true - low, TURN) + low
    jumps = int((np.abs(np.diff(wrapped)) > math.pi).sum())
    cleaned = clean(with_angle(trial, wrapped))
    name, message = only(cleaned)
    assert name == "wrapped_angles"
    assert f"joint.arm jumps by a turn {jumps} times, first at t = " in message
    straight = cleaned.trial.signals["joint.arm"]
    np.testing.assert_allclose(straight - straight[0], true - true[0], atol=1e-9)
    assert abs(straight.max() + straight.min()) / 2.0 <= 0.6 * TURN
    np.testing.assert_array_equal(cleaned.recorded.signals["joint.arm"], wrapped)


def test_a_joint_about_zero_stays_there_when_unwrapped() -> None:
    trial = log(size=1.2)
    true = trial.signals["joint.arm"]
    cleaned = clean(with_angle(trial, np.mod(true, TURN)))
    np.testing.assert_allclose(cleaned.trial.signals["joint.arm"], true, atol=1e-9)


def test_a_sudden_large_step_is_not_wrapped() -> None:
    time = np.arange(0.0, 4.0, 0.1)
    commanded = np.where(time % 2.0 < 1.0, -2.0, 2.0)
    assert names(recording(time, commanded, np.round(commanded / COUNT) * COUNT)) == []


def test_an_angle_that_is_stuck_before_a_jump_is_masked() -> None:
    trial = log(seconds=8.0)
    angle = trial.signals["joint.arm"].copy()
    moving = np.abs(angle - angle[np.arange(len(angle)) - 12])
    begin = int(moving[20:].argmax()) + 20 - 12
    angle[begin : begin + 12] = angle[begin]
    cleaned = clean(with_angle(trial, angle))
    name, message = only(cleaned)
    assert name == "stuck_angles"
    assert "12 samples" not in message
    assert f"11 samples of joint.arm stuck, first at t = {trial.time[begin + 1]:.2f} s" in message
    np.testing.assert_array_equal(
        np.flatnonzero(~cleaned.trial.used["joint.arm"]), np.arange(begin + 1, begin + 12)
    )


@pytest.mark.parametrize("begin", [0, 100])
def test_an_angle_that_never_changes_again_is_named_and_kept(begin: int) -> None:
    trial = log(seconds=6.0)
    angle = trial.signals["joint.arm"].copy()
    angle[begin:] = angle[begin]
    cleaned = clean(with_angle(trial, angle))
    name, message = only(cleaned)
    assert name == "stuck_angles"
    since = trial.time[np.flatnonzero(angle != angle[-1])[-1] + 1] if begin else 0.0
    assert f"joint.arm never changes from t = {since:.2f} s on" in message
    assert cleaned.trial.used["joint.arm"].all()


def test_an_arm_without_power_may_lie_still() -> None:
    trial = log(seconds=6.0)
    angle = trial.signals["joint.arm"].copy()
    angle[100:] = angle[100]
    off = np.where(np.arange(len(angle)) >= 95, np.nan, targets(trial.time))
    assert names(recording(trial.time, off, angle)) == []


def test_another_angle_is_not_masked_with_a_stuck_one() -> None:
    trial = log(seconds=8.0)
    angle = trial.signals["joint.arm"].copy()
    moving = np.abs(angle - angle[np.arange(len(angle)) - 12])
    begin = int(moving[20:].argmax()) + 20 - 12
    stuck = angle.copy()
    stuck[begin : begin + 12] = stuck[begin]
    both = Trial.of("log", trial.drive, trial.time, {"joint.arm": angle, "joint.other": stuck})
    cleaned = clean(both)
    assert cleaned.trial.used["joint.arm"].all()
    assert not cleaned.trial.used["joint.other"].all()


def test_a_site_that_turns_on_and_on_keeps_its_first_turn() -> None:
    time = np.arange(0.0, 8.0, 0.02)
    yaw = 2.0 + 2.0 * time
    wrapped = np.mod(yaw + math.pi, TURN) - math.pi
    cleaned = clean(Trial.of("walk", log().drive, time, {"site.tip.yaw": wrapped}))
    assert [defect.name for defect in cleaned.defects] == ["wrapped_angles"]
    np.testing.assert_allclose(cleaned.trial.signals["site.tip.yaw"], yaw, atol=1e-9)


@pytest.mark.parametrize("step_deg", [5.0, 10.0])
def test_a_coarse_sensor_is_named_with_its_step_and_counts_as_noise(step_deg: float) -> None:
    step = math.radians(step_deg)
    cleaned = clean(log(step_rad=step))
    (defect,) = cleaned.defects
    assert defect.name == "coarse_angles"
    assert defect.parameters["step_rad"] == pytest.approx(step)
    assert f"joint.arm has steps of {step:.3g} rad ({step_deg:.3g}°)" in defect.message
    assert f"counts as noise of {step / math.sqrt(12.0):.2g} rad" in defect.message
    assert cleaned.trial.steps_rad == pytest.approx({"joint.arm": step})
    assert cleaned.trial.used["joint.arm"].all()


def test_steps_are_found_though_they_were_rounded_when_written() -> None:
    trial = log(step_rad=math.radians(5.0))
    rounded = np.round(trial.signals["joint.arm"], 4)
    (defect,) = clean(with_angle(trial, rounded)).defects
    assert defect.parameters["step_rad"] == pytest.approx(math.radians(5.0), rel=1e-3)


def test_joints_of_a_walk_are_judged_and_its_marker_is_left_alone() -> None:
    """A trial of a gait with a marker and a joint: what is new concerns the joint."""
    walk = recorded()
    bend = 0.3 * np.sin(2.0 * np.pi * walk.time / GAIT.period_s) + 3.0
    noisy = bend + 1e-3 * np.random.default_rng(2).standard_normal(len(bend))
    signals = {**walk.signals, "joint.bend": np.mod(noisy + np.pi, TURN) - np.pi}
    cleaned = clean(Trial.of("walk", GAIT, walk.time, signals))
    assert [defect.name for defect in cleaned.defects] == ["wrapped_angles"]
    for name in walk.signals:
        assert cleaned.trial.signals[name] is signals[name]
        assert cleaned.trial.used[name].all()
    assert clean(Trial.of("walk", GAIT, walk.time, {**walk.signals, "joint.bend": noisy})).defects == ()
