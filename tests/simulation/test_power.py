"""Servos that lose their power and get it back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import rigs

from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.power import changes_of_power, held_while_unpowered
from gaitopt.simulation.rollout import RolloutSettings, Simulator

OFF = math.nan


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm on one servo; gravity pulls it down where the servo is unpowered."""
    return rigs.build(
        tmp_path_factory.mktemp("rig") / "arm", rigs.arm(), {"marker": "tip", "hinges": ["elbow"]}
    )


def cut(begin: float, end: float, seconds: float = 1.5, start: float = 0.28) -> LoggedCommands:
    """A servo that holds 0.3 rad, and has no power from `begin` to `end`."""
    log = LoggedCommands.of(["turn"], [0.0, begin, end], [[0.3], [OFF], [0.3]])
    return log.recorded(seconds, 0.02, {"elbow": start})


def test_an_unpowered_servo_gives_no_torque_and_the_arm_falls(arm: Problem) -> None:
    path = Simulator.build(arm).run(cut(0.5, 1.0))
    time, torque, angle = path.time, path["torque.turn"], path["joint.elbow"]
    off = (time >= 0.4999) & (time < 0.9999)
    assert np.array_equal(torque == 0.0, off)
    assert np.array_equal(np.isnan(path["target.turn"]), off)
    # With the arm's inertia of 0.0021 kg m2, gravity and the joint's damping alone accelerate it.
    first = (time >= 0.5) & (time < 0.52)
    fall = np.polyfit(time[first] - 0.5, angle[first], 2)[0] * 2.0
    assert fall == pytest.approx(-0.1 * 9.81 * 0.1 * math.cos(0.28) / 2.1e-3, rel=0.1)
    assert angle[-1] > angle[off][-1] + 0.5


def test_power_may_change_within_a_chunk_of_the_rollout(arm: Problem) -> None:
    log = cut(0.137, 0.891)
    usual = Simulator.build(arm).run(log)
    for chunk in (1, 7, 100_000):
        other = Simulator.build(arm, settings=RolloutSettings(chunk=chunk)).run(log)
        np.testing.assert_array_equal(other["joint.elbow"], usual["joint.elbow"])


def test_a_servo_without_power_from_the_beginning(arm: Problem) -> None:
    log = LoggedCommands.of(["turn"], [0.0, 0.5], [[OFF], [OFF]]).recorded(0.5, 0.02, {"elbow": -1.0})
    path = Simulator.build(arm).run(log)
    assert not path["torque.turn"].any()
    assert path["joint.elbow"][0] == -1.0
    assert path["joint.elbow"][-1] < -1.1


@pytest.mark.parametrize(
    ("effect", "value"),
    [
        ("servo_deadband", {"half_width_rad": 0.02}),
        ("servo_backlash", {"half_width_rad": 0.02}),
        ("servo_speed_limit", {"limit_rad_s": 2.0}),
        ("servo_sag", {"share_lost": 0.3}),
        ("servo_travel", {"gain": 0.9}),
        ("servo_trim", {"offset_rad": 0.05}),
        ("command_latency", {"delay_s": 0.0405}),
        ("servo_torque_limit", {"limit_n_m": 0.3}),
    ],
)
def test_with_any_effect_of_a_servo_it_falls_as_freely(
    arm: Problem, effect: str, value: dict[str, float]
) -> None:
    log = LoggedCommands.of(["turn"], [0.0, 0.3], [[0.3], [OFF]]).recorded(1.0, 0.02, {"elbow": 0.28})
    path = Simulator.build(arm.with_effects({effect: value})).run(log)
    assert path.status == "ok"
    late = path.time > 0.36
    assert np.abs(path["torque.turn"][late]).max() < (0.02 if effect == "servo_backlash" else 1e-12)
    assert np.isfinite(path["joint.elbow"]).all()
    assert path["joint.elbow"][-1] < -1.0


def test_a_late_channel_loses_its_power_late(arm: Problem) -> None:
    log = LoggedCommands.of(["turn"], [0.0, 0.3, 0.6], [[0.3], [OFF], [0.2]]).recorded(
        1.0, 0.02, {"elbow": 0.28}
    )
    late = arm.with_effects({"channel_timing": {"delay_s": 0.0205, "target": "turn"}})
    torque = Simulator.build(late).run(log)["torque.turn"]
    off = np.flatnonzero(torque == 0.0)
    assert (off[0], off[-1]) == (320, 619)


def test_a_speed_limit_begins_where_the_servo_was_before_it_lost_its_power(arm: Problem) -> None:
    log = LoggedCommands.of(["turn"], [0.0, 0.1, 0.2], [[0.0], [OFF], [0.4]]).recorded(
        0.5, 0.02, {"elbow": 0.0}
    )
    simulator = Simulator.build(arm.with_effects({"servo_speed_limit": {"limit_rad_s": 2.0}}))
    sent = simulator.effects.commands(log.targets, simulator.models[0])(np.arange(0.0, 0.5, 1e-3))[:, 0]
    assert np.isnan(sent[100:200]).all()
    assert sent[99] == 0.0
    assert sent[200] == pytest.approx(0.002)
    assert sent[299] == pytest.approx(0.2)


def test_a_tether_pulls_at_an_unpowered_robot_too(arm: Problem) -> None:
    log = LoggedCommands.of(["turn"], [0.0], [[OFF]]).recorded(1.0, 0.02, {"elbow": -math.pi / 2})
    pulled = arm.with_effects({"tether_drag": {"force_n": 0.1}})
    free, backward = (Simulator.build(problem).run(log)["joint.elbow"] for problem in (arm, pulled))
    assert np.ptp(free) < 1e-3  # it hangs
    assert backward.min() < -math.pi / 2 - 0.1


def test_metrics_leave_out_what_has_no_target(arm: Problem) -> None:
    simulator = Simulator.build(arm)
    drive = cut(0.5, 1.0)
    metrics = measure(arm, drive, simulator.run(drive), Robot.of(simulator.models[0]))
    assert metrics["reached"] == 1.0  # the target never changed
    nothing = replace(drive, rows=np.full_like(drive.rows, OFF))
    metrics = measure(arm, nothing, simulator.run(nothing), Robot.of(simulator.models[0]))
    assert metrics["reached"] == 1.0


def test_an_unpowered_input_holds_its_last_command() -> None:
    ctrl = np.array([[OFF, 1.0, OFF], [2.0, OFF, OFF], [OFF, 3.0, OFF]])
    held, before, off = held_while_unpowered(ctrl, np.array([OFF, 0.5, OFF]))
    assert held.tolist() == [[2.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 3.0, 0.0]]
    assert before.tolist() == [2.0, 0.5, 0.0]
    assert off is not None
    assert changes_of_power(off) == [1, 2]
    assert held_while_unpowered(held, before)[2] is None
    assert changes_of_power(None) == []
