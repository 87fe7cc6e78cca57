"""Components of a gap without a period: where only one thing differs, it gets the largest share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drives import Sampled
from responses import FRAME_S, NOISE_RAD, SIGNAL, Servo, beside, commands, recorded

from gaitopt.diagnose.gap.align import Aligned, align
from gaitopt.diagnose.gap.components import limited
from gaitopt.diagnose.gap.leftover import channel_of, jumps, starts_with_jump
from gaitopt.diagnose.gap.split import Split
from gaitopt.diagnose.gap.split_commands import COMMAND_COMPONENTS, split_commands
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.trajectory import Trajectory

STEPS = [("step", 0.05, 0.24), ("step", 0.16, 0.24), ("step", 1.7, 1.0)]
SQUARES = [("square", 0.05, 2.0), ("square", 0.16, 2.0), ("square", 1.0, 3.0)]
TELEGRAPHS = [("telegraph", 0.5, 3.0), ("telegraph", 1.9, 3.0)]
RAMPS = [("ramp", 0.3, 2.0), ("ramp", 1.9, 2.0)]
SWINGS = [("chirp", 0.2, 3.0), ("chirp", 1.9, 4.0), ("triangle", 0.9, 2.0)]
JUMPING = [*STEPS, *SQUARES, *TELEGRAPHS]
ALL = [*JUMPING, ("telegraph", 0.05, 3.0), *RAMPS, *SWINGS]

Shape = tuple[str, float, float]


def of(aligned: Aligned, noise: float = NOISE_RAD) -> Split:
    """The components of a made gap, which add up to it."""
    part = split_commands(aligned, SIGNAL, noise, {})
    assert tuple(part.squares) == COMMAND_COMPONENTS
    assert part.rms == pytest.approx(aligned.rms(SIGNAL))
    assert min(part.squares.values()) >= 0.0
    return part


def share(part: Split, component: str) -> float:
    """The share of a component, which must be the largest one."""
    assert max(part.squares, key=lambda name: part.squares[name]) == component, part.squares
    return part.squares[component] / part.rms**2


@pytest.mark.parametrize("shape", ALL)
def test_a_smaller_motion_is_gain(shape: Shape) -> None:
    part = of(beside(*shape, lambda time, response: 0.8 * response(time)))
    assert share(part, "gain") > 0.95
    assert part.size == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("shape", ALL)
def test_a_constant_distance_is_bias(shape: Shape) -> None:
    part = of(beside(*shape, lambda time, response: response(time) + 0.2 * shape[1]))
    assert share(part, "bias") > 0.95


@pytest.mark.parametrize("late", [0.03, -0.03])
@pytest.mark.parametrize("shape", ALL)
def test_the_same_motion_late_or_early_is_lag(shape: Shape, late: float) -> None:
    part = of(beside(*shape, lambda time, response: response(time - late)))
    assert share(part, "lag") > 0.95
    assert part.delay_s == pytest.approx(late, abs=0.003)


@pytest.mark.parametrize("shape", ALL)
def test_a_slower_servo_is_lag(shape: Shape) -> None:
    assert share(of(beside(*shape, measured=Servo(hz=3.0))), "lag") > 0.6


@pytest.mark.parametrize("shape", [shape for shape in ALL if shape[2] >= 1.0])
def test_a_slow_change_is_drift(shape: Shape) -> None:
    seconds = shape[2]
    part = of(beside(*shape, lambda time, response: response(time) + 0.15 * shape[1] * time / seconds))
    assert share(part, "drift") > 0.95


@pytest.mark.parametrize("shape", ALL)
def test_a_noisy_sensor_is_noise(shape: Shape) -> None:
    assert share(of(beside(*shape, noise=0.1 * shape[1]), 0.1 * shape[1]), "noise") > 0.7


@pytest.mark.parametrize("shape", [*JUMPING, ("telegraph", 0.05, 3.0)])
def test_ringing_after_jumps_is_overshoot(shape: Shape) -> None:
    assert share(of(beside(*shape, measured=Servo(damping=0.25))), "overshoot") > 0.5


@pytest.mark.parametrize("shape", [STEPS[-1], *SQUARES])
def test_ringing_that_is_only_simulated_is_overshoot(shape: Shape) -> None:
    assert share(of(beside(*shape, simulated=Servo(damping=0.25))), "overshoot") > 0.5


@pytest.mark.parametrize("shape", RAMPS)
def test_a_ramp_climbed_in_steps_is_stick_and_slip(shape: Shape) -> None:
    rise = 0.05 * shape[1]
    part = of(beside(*shape, lambda time, response: rise * np.round(response(time) / rise)))
    assert share(part, "stick_slip") > 0.8


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("shape", [*JUMPING, *SWINGS])
def test_a_limit_of_the_speed_is_saturation(shape: Shape, swapped: bool) -> None:
    """The limit is half of what the chirp needs, and far below what jumps need."""
    slow, quick = Servo(limit=shape[1] * (6.0 if shape[0] == "chirp" else 4.0)), Servo()
    measured, simulated = (quick, slow) if swapped else (slow, quick)
    assert share(of(beside(*shape, measured=measured, simulated=simulated)), "saturation") > 0.9


def test_the_largest_of_two_causes_comes_first() -> None:
    part = of(beside("square", 1.0, 3.0, lambda time, response: 0.9 * response(time - 0.05)))
    ordered = sorted(part.squares, key=lambda name: -part.squares[name])
    assert ordered[:2] == ["lag", "gain"]
    assert part.delay_s == pytest.approx(0.05, abs=0.003)
    assert part.size == pytest.approx(0.9, abs=0.02)


def test_a_free_origin_has_neither_bias_nor_limit() -> None:
    drive = commands("triangle", 0.9, 2.0)
    path = Servo().follow(drive, 2.3)
    measured = recorded(path, drive, 2.0, lambda time, response: 5.0 + 0.8 * response(time))
    marker = replace(
        measured, signals={"marker.x": measured.signals[SIGNAL]}, used={"marker.x": measured.used[SIGNAL]}
    )
    aligned = align(marker, Trajectory(path.time, {"marker.x": path[SIGNAL]}))
    part = split_commands(aligned, "marker.x", NOISE_RAD, {})
    assert part.rms == pytest.approx(aligned.rms("marker.x"))
    assert part.squares["gain"] > 0.95 * part.rms**2
    assert part.squares["bias"] == part.squares["saturation"] == 0.0


def test_samples_that_do_not_count_leave_the_components_as_they_are() -> None:
    whole = beside("square", 1.0, 3.0, lambda time, response: response(time - 0.05))
    flags = np.arange(len(whole.time)) % 7 == 3
    part = of(align(whole.trial.masked(flags), whole.simulated))
    assert share(part, "lag") > 0.95


def test_errors_of_defects_are_added_to_their_component() -> None:
    aligned = beside("square", 1.0, 3.0)
    before, after = (
        split_commands(aligned, SIGNAL, NOISE_RAD, extra) for extra in ({}, {"timing": 4.0, "noise": 1.0})
    )
    assert after.squares["lag"] - before.squares["lag"] == pytest.approx(4.0)
    assert after.squares["noise"] - before.squares["noise"] == pytest.approx(1.0)


def test_a_perfect_prediction_has_no_components() -> None:
    aligned = beside("step", 0.16, 0.24, noise=0.0)
    assert split_commands(aligned, SIGNAL, 0.0, {}).rms == pytest.approx(0.0, abs=1e-9)


def test_a_joint_that_never_moves_is_split() -> None:
    time = np.arange(0.0, 0.24, FRAME_S)
    drive = Sampled(time, np.zeros((len(time), 1)), "still")
    trial = replace(Trial.of("still", drive, time, {SIGNAL: np.full(len(time), 0.1)}), starts_at_s=0.0)
    fine = np.arange(0.0, 0.5, 1e-3)
    part = of(align(trial, Trajectory(fine, {SIGNAL: np.zeros(len(fine))})), 0.0)
    assert share(part, "bias") == pytest.approx(1.0)


def test_a_dropped_arm_is_split() -> None:
    """The commands are cut at 0.2 s; the arm falls a little later than simulated."""
    time = np.arange(0.0, 1.2, FRAME_S)
    rows = np.where(time < 0.2, 0.0, np.nan)[:, None]
    drive = Sampled(time, rows, "drop")

    def fall(at: np.ndarray) -> np.ndarray:
        return np.maximum(-5.0 * np.maximum(at - 0.2, 0.0) ** 2, -1.7)

    trial = replace(Trial.of("drop", drive, time, {SIGNAL: fall(time - 0.03)}), starts_at_s=0.0)
    fine = np.arange(0.0, 1.5, 1e-3)
    signals = {SIGNAL: fall(fine), "position.turn": fall(fine), "target.turn": drive.targets(fine)[:, 0]}
    assert share(of(align(trial, Trajectory(fine, signals))), "lag") > 0.95


def test_jumps_stand_out_from_the_rows_around() -> None:
    rows = np.concatenate([np.zeros(5), np.ones(5), 1.0 + 0.1 * np.arange(1, 8)])[:, None]
    assert np.flatnonzero(jumps(rows)).tolist() == [5]
    cut = np.where(np.arange(17)[:, None] < 8, rows, np.nan)
    assert np.flatnonzero(jumps(cut)).tolist() == [5, 8]


def test_a_first_command_far_from_the_start_is_a_jump() -> None:
    step, ramp = commands("step", 0.5, 1.0), commands("ramp", 0.5, 1.0)
    assert starts_with_jump(step, Servo().follow(step, 1.0))
    assert not starts_with_jump(ramp, Servo().follow(ramp, 1.0))


def test_a_joints_channel_is_the_one_that_turns_it() -> None:
    path = Servo().follow(commands("step", 0.5, 1.0), 1.0)
    assert channel_of(path, SIGNAL) == 0
    other = replace(path, signals={**path.signals, "joint.other": np.zeros(len(path.time))})
    assert channel_of(other, "joint.other") is None


def test_a_limited_series_follows_no_faster() -> None:
    time = np.arange(0.0, 1.0, 0.1)
    (slow, quick) = limited(time, np.where(time > 0.25, 1.0, 0.0), np.array([2.0, 100.0]))
    np.testing.assert_allclose(slow, np.clip(0.2 * (np.arange(10) - 2), 0.0, 1.0), atol=1e-12)
    np.testing.assert_allclose(quick, np.where(time > 0.25, 1.0, 0.0))


def test_a_joint_that_only_moves_in_reality_is_gain() -> None:
    shape = ("step", 0.16, 0.24)
    stuck = align(beside(*shape).trial, Servo(limit=1e-4).follow(commands(*shape), 0.5))
    part = of(stuck)
    assert share(part, "gain") > 0.9
    assert part.size > 20.0
