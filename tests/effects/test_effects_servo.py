"""Each servo effect in a case with a known answer: an arm on one servo, a step, a stall."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rigs
from scipy.optimize import least_squares

from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

LOAD = 0.1 * 9.81 * 0.1
"""Torque of gravity on the level arm, N m."""

STALL, GAIN = 0.5, 2.0


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes the arm."""
    numbers = itertools.count()

    def make(**options: float) -> Problem:
        folder: Path = tmp_path_factory.mktemp("arm") / str(next(numbers))
        return rigs.build(folder, rigs.arm(**options), {"marker": "tip"})

    return make


def last(trajectory: Trajectory, signal: str) -> float:
    return float(trajectory[signal][-1])


def test_a_torque_limit_stalls_the_servo_at_that_torque(rig: rigs.Make) -> None:
    limit = 0.05
    stalled = rigs.hold(rig(), 1.5, 3.0, servo_torque_limit={"limit_n_m": limit})
    assert last(stalled, "torque.turn") == pytest.approx(limit, rel=1e-9)
    assert LOAD * math.cos(last(stalled, "joint.elbow")) == pytest.approx(limit, rel=1e-3)


def test_a_speed_limit_is_the_slope_of_the_angle(rig: rigs.Make) -> None:
    followed = rigs.hold(rig(gravity=0.0, damping=0.1), 1.4, 1.5, servo_speed_limit={"limit_rad_s": 2.0})
    slope = (followed["joint.elbow"][600] - followed["joint.elbow"][400]) / 0.2
    assert slope == pytest.approx(2.0, rel=2e-3)
    assert last(followed, "joint.elbow") == pytest.approx(1.4, abs=1e-3)


def test_a_gain_divides_the_error_under_a_load(rig: rigs.Make) -> None:
    for scale in (0.5, 3.0):
        angle = last(rigs.hold(rig(), 0.0, 2.0, servo_gain={"scale": scale}), "joint.elbow")
        assert GAIN * scale * -angle == pytest.approx(LOAD * math.cos(angle), rel=1e-6)


def test_damping_sets_the_no_load_speed(rig: rigs.Make) -> None:
    spun = rigs.hold(rig(gravity=0.0), 1e3, 1.5, servo_damping={"scale": 2.0})
    assert last(spun, "rate.turn") == pytest.approx(STALL / 0.04, rel=1e-3)


def test_a_rotor_slows_the_start(rig: rigs.Make) -> None:
    free = rig(gravity=0.0, damping=0.0)
    for armature in (1e-4, 4e-3):
        begun = rigs.hold(free, 1e3, 0.02, servo_inertia={"armature_kg_m2": armature})
        inertia = 2e-3 + armature
        assert last(begun, "rate.turn") == pytest.approx(STALL / inertia * 0.02, rel=1e-6)


def test_a_dead_band_leaves_its_half_width_and_the_load_s_error(rig: rigs.Make) -> None:
    held = rigs.hold(rig(), 0.0, 2.0, servo_deadband={"half_width_rad": 0.05})
    angle = last(held, "joint.elbow")
    assert -angle == pytest.approx(0.05 + LOAD * math.cos(angle) / GAIN, rel=1e-6)
    assert last(held, "torque.turn") == pytest.approx(LOAD * math.cos(angle), rel=1e-6)


def test_a_dead_band_stops_short_without_a_load(rig: rigs.Make) -> None:
    moved = rigs.hold(rig(gravity=0.0, damping=0.2), 0.3, 3.0, servo_deadband={"half_width_rad": 0.05})
    assert last(moved, "joint.elbow") == pytest.approx(0.25, abs=1e-4)


def test_a_dead_band_keeps_the_torque_limit(rig: rigs.Make) -> None:
    problem = rig()
    effects = {"servo_deadband": {"half_width_rad": 0.05}, "servo_torque_limit": {"limit_n_m": 0.05}}
    stalled = rigs.hold(problem, 1.5, 3.0, **effects)
    assert last(stalled, "torque.turn") == pytest.approx(0.05, rel=1e-9)
    robot = Robot.of(Simulator.build(problem.with_effects(effects)).models[0])
    assert robot.torque_limit == pytest.approx([0.05])


@pytest.mark.parametrize("gravity", [9.81, -9.81])
def test_backlash_lets_the_link_move_by_its_half_width_to_either_side(rig: rigs.Make, gravity: float) -> None:
    play = math.radians(2.0)
    held = rigs.hold(rig(gravity=gravity), 0.0, 2.0, servo_backlash={"half_width_rad": play})
    hung = last(held, "joint.elbow") - last(held, "position.turn")
    assert hung == pytest.approx(-math.copysign(play, gravity), abs=math.radians(0.02))
    assert abs(last(held, "torque.turn")) == pytest.approx(
        LOAD * math.cos(last(held, "joint.elbow")), rel=1e-3
    )
    assert np.ptp(held["joint.elbow"]) < 1e-5, "it starts at rest"


def test_backlash_turns_the_link_only_after_the_play_is_taken_up(rig: rigs.Make) -> None:
    simulator = Simulator.build(rig(gravity=0.0).with_effects({"servo_backlash": {"half_width_rad": 0.04}}))
    time = simulator.clock(4.0)
    swing = simulator.play(time, 0.3 * np.sin(2.0 * np.pi * 0.5 * time)[:, None])
    behind = swing["position.turn"] - swing["joint.elbow"]
    assert behind.max() == pytest.approx(0.04, abs=2e-3)
    assert behind.min() == pytest.approx(-0.04, abs=2e-3)


def test_travel_and_trim_act_on_the_commanded_angle(rig: rigs.Make) -> None:
    free = rig(gravity=0.0, damping=0.1)
    assert last(rigs.hold(free, 1.0, 2.0, servo_travel={"gain": 0.9}), "joint.elbow") == pytest.approx(0.9)
    trimmed = rigs.hold(free, 0.0, 0.5, servo_trim={"offset_rad": 0.1})
    assert trimmed["joint.elbow"] == pytest.approx(0.1, abs=1e-6), "it starts where it is held"
    assert trimmed["target.turn"] == pytest.approx(0.0), "what is sent is not what arrives"


def test_a_stalled_servo_alone_on_its_supply_loses_what_it_draws(rig: rigs.Make) -> None:
    """The torque t = L (1 - s t / L) that is left is L / (1 + s)."""
    problem = rig(damping=1.0)
    for share in (0.3, 1.0):
        effects = {"servo_sag": {"share_lost": share}, "servo_torque_limit": {"limit_n_m": 0.08}}
        stalled = rigs.hold(problem, 1.5, 4.0, **effects)
        assert last(stalled, "torque.turn") == pytest.approx(0.08 / (1.0 + share), rel=2e-3)


@pytest.mark.parametrize("name", ["command_latency", "channel_timing"])
def test_a_latency_of_50_ms_shows_at_50_ms(rig: rigs.Make, name: str) -> None:
    problem = rig(gravity=0.0)
    effect: dict[str, Any] = {"delay_s": 0.05} | ({"target": "turn"} if name == "channel_timing" else {})
    prompt, late = rigs.hold(problem, 0.5, 0.5), rigs.hold(problem, 0.5, 0.5, **{name: effect})
    assert np.array_equal(late["joint.elbow"][50:], prompt["joint.elbow"][:-50])
    assert np.ptp(late["joint.elbow"][:51]) == 0.0


@pytest.mark.parametrize("gait", ["square-2s", "square-1s"])
@pytest.mark.parametrize("other", [{}, {"servo_speed_limit": {"limit_rad_s": 6.0}}])
def test_a_latency_is_a_late_motion_by_any_time(arcfold: Problem, gait: str, other: dict[str, Any]) -> None:
    """Square waves saturate a servo, so its response to a part of a jump is that to the whole jump."""
    walk = arcfold.baselines[gait]
    prompt = Simulator.build(arcfold.with_effects(other)).run(walk, duration=1.5)
    for delay in (0.0102, 0.0107):
        effects = other | {"command_latency": {"delay_s": delay}}
        simulator = Simulator.build(arcfold.with_effects(effects))
        seen = simulator.observe(simulator.run(walk, duration=1.5))
        for signal in ("position.mid_act", "marker.x"):
            shifted = np.interp(seen.time - delay, prompt.time, prompt[signal])
            assert seen[signal] == pytest.approx(shifted, abs=1e-6)
        assert np.array_equal(seen["target.mid_act"], prompt["target.mid_act"]), "what is sent stays"


@pytest.mark.parametrize("other", [{}, {"servo_speed_limit": {"limit_rad_s": 6.0}}])
def test_one_late_servo_at_rest_is_late_by_any_time(arcfold: Problem, other: dict[str, Any]) -> None:
    """Each tenth of a millisecond has the same effect, because the joint begins at rest."""
    walk = arcfold.baselines["square-2s"]

    def late(delay: float) -> Trajectory:
        effects = other | {"channel_timing": {"delay_s": delay, "target": "mid_act"}}
        return Simulator.build(arcfold.with_effects(effects)).run(walk, duration=0.6)

    before = late(0.010)
    early, time = before["position.mid_act"], before.time
    for rest in (0.2e-3, 0.5e-3, 0.8e-3):
        turned = late(0.010 + rest)["position.mid_act"]
        found = least_squares(lambda s, at=turned: np.interp(time - s, time, early) - at, 0.0, x_scale=1e-3)
        assert found.x[0] == pytest.approx(rest, abs=0.06e-3)


def test_a_channel_s_timing_between_two_steps_is_their_blend(strider: Problem) -> None:
    effects: dict[str, Any] = {"channel_timing": {"delay_s": 0.0025, "target": "front"}}
    simulator = Simulator.build(strider.with_effects(effects))
    model = simulator.models[0]
    slow = simulator.effects.commands(lambda t: np.tile(0.1 * t[:, None], 2), model)
    step = simulator.fidelity.timestep_s
    assert slow(np.array([0.1, 0.2]))[:, 1] == pytest.approx([0.00975, 0.01975], abs=1e-12)
    jump = simulator.effects.commands(lambda t: np.tile((t >= 0.0)[:, None] * 1.0, 2), model)
    saturates = model.actuator_forcerange[1, 1] / model.actuator_gainprm[1, 0]
    share = 1.0 - (0.0025 / step) % 1.0
    at_jump = jump(np.array([math.floor(0.0025 / step) * step]))
    assert at_jump[0, 1] == pytest.approx(share * saturates), "no more than the servo answers to"


def test_channel_timing_moves_one_channel_early_or_late(strider: Problem) -> None:
    gait = strider.baselines["stride"]
    for delay in (-0.02, 0.03):
        effects: dict[str, Any] = {"channel_timing": {"delay_s": delay, "target": "front"}}
        simulator = Simulator.build(strider.with_effects(effects))
        time = np.arange(100.0, 400.0) * simulator.fidelity.timestep_s
        arriving = simulator.effects.commands(gait.targets, simulator.models[0])(time)
        assert arriving[:, 0] == pytest.approx(gait.targets(time)[:, 0], abs=1e-15)
        assert arriving[:, 1] == pytest.approx(gait.targets(time - delay)[:, 1], abs=1e-9)


def test_one_target_leaves_the_other_servos_alone(strider: Problem) -> None:
    changed = Simulator.build(
        strider.with_effects({"servo_torque_limit": {"limit_n_m": 0.01, "target": "front"}})
    )
    assert changed.models[0].actuator_forcerange[:, 1] == pytest.approx([0.04, 0.01])
