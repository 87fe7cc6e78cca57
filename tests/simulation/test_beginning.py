"""Rollouts that begin at measured joint angles."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rigs
from helpers import edited, same_bits

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.beginning import held_before
from gaitopt.simulation.rollout import Simulator

ROLES = {"marker": "tip", "hinges": ["elbow"]}


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm on one servo."""
    return rigs.build(tmp_path_factory.mktemp("rig") / "arm", rigs.arm(), ROLES)


def constant(target: float, start: dict[str, float] | None, channel: str = "turn") -> LoggedCommands:
    """One command from a start."""
    return LoggedCommands.of([channel], [0.0], [[target]]).recorded(0.5, 0.02, start)


def test_a_rollout_begins_at_rest_at_the_measured_angle(arm: Problem) -> None:
    path = Simulator.build(arm).run(constant(0.5, {"elbow": 0.4}))
    assert path["joint.elbow"][0] == 0.4
    assert path["rate.turn"][0] == 0.0
    assert path["position.turn"][0] == 0.4


def test_without_a_measured_angle_it_begins_at_the_problems_start(arm: Problem) -> None:
    simulator = Simulator.build(arm)
    path = simulator.run(constant(0.5, None))
    assert path["joint.elbow"][0] == simulator.run(arm.baselines["still"])["joint.elbow"][0]


def test_a_start_of_one_rollout_is_not_that_of_the_next(arm: Problem) -> None:
    simulator = Simulator.build(arm)
    still = simulator.run(arm.baselines["still"])
    simulator.run(constant(0.5, {"elbow": 0.4}))
    assert same_bits(still, simulator.run(arm.baselines["still"]))


@pytest.mark.parametrize("effect", [None, "servo_backlash"])
@pytest.mark.parametrize(
    ("measured", "first", "held"),
    [(0.05, 1.0, 0.0), (0.95, 1.0, 1.0), (-1.2, 1.0, -1.2), (0.05, math.nan, math.nan)],
)
def test_what_was_held_before_is_the_start_target_the_first_target_or_the_measured_angle(
    arm: Problem, measured: float, first: float, held: float, effect: str | None
) -> None:
    problem = arm.with_effects({effect: {"half_width_rad": 0.02}}) if effect else arm
    model = Simulator.build(problem).models[0]
    found = held_before(problem, constant(first, {"elbow": measured}), model)
    np.testing.assert_array_equal(found, [held])


def test_a_late_command_leaves_the_servo_at_rest_first(arm: Problem) -> None:
    late = Simulator.build(arm.with_effects({"command_latency": {"delay_s": 0.1}}))
    start = {"elbow": -0.05}  # where gravity pulls it, under a target of 0
    path = late.run(constant(0.8, start))
    assert np.abs(path["joint.elbow"][path.time < 0.1] + 0.05).max() < 2e-3
    assert path["joint.elbow"][-1] > 0.6


def test_the_parts_that_effects_add_begin_there_too(arm: Problem) -> None:
    loose = Simulator.build(arm.with_effects({"servo_backlash": {"half_width_rad": 0.02}}))
    path = loose.run(constant(0.4, {"elbow": 0.4}))
    assert path["joint.elbow"][0] == 0.4
    assert path["position.turn"][0] == pytest.approx(0.42), "the rotor carries the arm"


@pytest.mark.parametrize("bend", [0.3, 1.2])
@pytest.mark.parametrize("joint", ["mid_left", "last_left", "mid_right"])
def test_coupled_joints_follow_the_measured_ones(arcfold: Problem, bend: float, joint: str) -> None:
    share = {"mid_left": 1.0, "last_left": -0.5, "mid_right": 1.0}
    log = LoggedCommands.of(arcfold.channel_names, [0.0], [[bend, 0.0, 0.0]])
    path = Simulator.build(arcfold).run(log.recorded(0.1, 0.02, {joint: share[joint] * bend}))
    for name in ("mid_left", "mid_right"):
        assert path[f"joint.{name}"][0] == pytest.approx(bend, abs=1e-5)
    for name in ("first_left", "last_left", "first_right", "last_right"):
        assert path[f"joint.{name}"][0] == pytest.approx(-0.5 * bend, abs=1e-5)
    assert path[f"joint.{joint}"][0] == pytest.approx(share[joint] * bend, abs=1e-6)


def test_two_measured_joints_that_contradict_each_other_share_the_difference(arcfold: Problem) -> None:
    log = LoggedCommands.of(arcfold.channel_names, [0.0], [[0.5, 0.0, 0.0]])
    path = Simulator.build(arcfold).run(log.recorded(0.1, 0.02, {"mid_left": 0.5, "mid_right": 0.52}))
    assert path["joint.mid_left"][0] == pytest.approx(0.51, abs=1e-3)
    assert path["joint.mid_right"][0] == pytest.approx(0.51, abs=1e-3)


def test_a_robot_on_the_ground_begins_on_the_ground(arcfold: Problem) -> None:
    simulator = Simulator.build(arcfold)
    still = simulator.run(arcfold.baselines["square-1s"], duration=0.1)["depth"][0]
    log = LoggedCommands.of(arcfold.channel_names, [0.0], [[0.5, -0.5, -0.5]])
    path = simulator.run(log.recorded(0.1, 0.02, {"mid_left": 0.5, "foot1": -0.5, "foot2": -0.5}))
    assert path.status == "ok"
    assert path["depth"][0] == pytest.approx(still, abs=1e-6)


def test_an_actuator_with_a_lag_has_held_what_it_holds_for_long(tmp_path: Path) -> None:
    folder = tmp_path / "arm"
    rigs.build(folder, rigs.arm(), ROLES)
    edited(folder / "rig.xml", 'kp="2"', 'kp="2" timeconst="0.05"')
    problem = load_problem(folder)
    simulator = Simulator.build(problem)
    held = simulator.run(constant(0.4, {"elbow": 0.35}))
    assert np.abs(held["joint.elbow"] - 0.35).max() < 0.02
    moved = simulator.run(constant(0.4, {"elbow": 0.0}))
    assert np.abs(moved["torque.turn"][0]) < 1e-12  # the lag begins at the target of the start, 0
    assert moved["torque.turn"][50] == pytest.approx(
        2.0 * (0.4 * (1.0 - math.exp(-1.0)) - moved["joint.elbow"][50]), abs=0.01
    )


def test_an_actuator_with_a_lag_starts_a_gait_from_its_start_target(tmp_path: Path) -> None:
    folder = tmp_path / "arm"
    rigs.build(folder, rigs.arm(), ROLES)
    edited(folder / "rig.xml", 'kp="2"', 'kp="2" timeconst="0.05"')
    edited(folder / "problem.toml", "[start]", "[start]\nctrl_deg = { turn = 30.0 }")
    model = Simulator.build(load_problem(folder)).models[0]
    assert model.keyframe("start").act == pytest.approx([math.radians(30.0)])


def test_a_start_of_an_unknown_joint_is_refused(arm: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"unknown joint 'elbo'; known: elbow \(nearest: 'elbow'\)"):
        Simulator.build(arm).run(constant(0.5, {"elbo": 0.0}))


@pytest.mark.parametrize("measured", [-0.05, -1.2])
def test_free_play_is_taken_up_by_the_load_at_the_start(measured: float) -> None:
    """The weight pulls the arm down: it rests on its rotor, which is above it by half of the play."""
    bench = load_problem("servo-bench").with_effects({"servo_backlash": {"half_width_rad": 0.03}})
    log = LoggedCommands.of(["servo"], [0.0], [[measured + 0.03]]).recorded(0.3, 0.02, {"arm": measured})
    path = Simulator.build(bench).run(log)
    assert path["joint.arm"][0] == measured
    assert path["position.servo"][0] == pytest.approx(measured + 0.03)
    sagged = 0.354 * 9.81 * 0.168 * math.cos(measured) / 25.0
    assert np.ptp(path["joint.arm"]) < 1.2 * sagged, "it does not fall through the play"
