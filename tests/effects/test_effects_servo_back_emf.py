"""Torque that servos lose with speed, and the damping of servos alone."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rigs
from helpers import same_bits

from gaitopt.core.errors import GaitoptError
from gaitopt.effects import EFFECTS
from gaitopt.effects.rows import effect_rows
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

LIMIT, INERTIA = 0.5, 1e-3
DAMPING = EFFECTS["servo_damping"]

Effects = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes two wheels on two servos."""
    numbers = itertools.count()

    def make(joint: str = "", servo: str = "", load: float = 0.0) -> Problem:
        folder: Path = tmp_path_factory.mktemp("twins") / str(next(numbers))
        mjcf = rigs.twins(INERTIA, load, joint, f'kp="20" forcerange="-{LIMIT} {LIMIT}" {servo}')
        return rigs.build(folder, mjcf, {"marker": "wheel"}, servos=rigs.TWO)

    return make


def lost(damping: float, target: str = "turn") -> Effects:
    return {"servo_back_emf": {"damping_n_m_s_rad": damping, "target": target}}


# --- the slope of the torque-speed line ---------------------------------------------------------


@pytest.mark.parametrize("gear", [1.0, 2.5])
def test_a_servo_turns_as_fast_as_its_torque_lasts(twins: rigs.Make, gear: float) -> None:
    """At any speed v, T - b v accelerates; at T / b nothing is left."""
    problem = twins(servo=f'gear="{gear}"')
    path = rigs.hold(problem, 1e3, 0.4, **lost(0.05))
    torque = LIMIT * gear
    expected = torque / 0.05 * (1.0 - np.exp(-0.05 / INERTIA * path.time))
    assert path["rate.turn"] / gear == pytest.approx(expected, rel=0.03, abs=0.03 * torque / 0.05)
    assert path["rate.turn"][-1] / gear == pytest.approx(torque / 0.05, rel=1e-6)
    assert path["torque.turn"][-1] == LIMIT, "it is outside of the limit"
    assert path["rate.other"][-1] / gear == pytest.approx(torque / INERTIA * 0.4, rel=1e-2)
    robot = Robot.of(Simulator.build(problem.with_effects(lost(0.05))).models[0])
    assert robot.damping == pytest.approx([0.05, 0.0])


def test_an_unpowered_servo_loses_nothing(twins: rigs.Make) -> None:
    off = math.nan
    log = LoggedCommands.of(rigs.TWO, [0.0, 0.05], [[1.5, 1.5], [off, 1.5]])
    path = Simulator.build(twins().with_effects(lost(0.05, "all"))).run(log, duration=0.2)
    rolling = path["rate.turn"][path.time > 0.051]
    assert np.ptp(rolling) < 1e-9
    assert rolling[0] > 5.0


def test_no_loss_changes_no_bit(twins: rigs.Make) -> None:
    assert same_bits(rigs.hold(twins(), 0.5, 0.3, **lost(0.0)), rigs.hold(twins(), 0.5, 0.3))


def test_half_the_step_changes_a_servo_s_speed_little(twins: rigs.Make) -> None:
    problem = twins(load=0.05).with_effects(lost(0.05, "all"))
    coarse, fine = (step(problem, step_s) for step_s in (1e-3, 0.5e-3))
    assert np.sqrt(np.mean((fine["joint.wheel"] - coarse["joint.wheel"]) ** 2)) < 2e-3
    assert np.ptp(fine["joint.wheel"]) > 0.4


def step(problem: Problem, step_s: float) -> Trajectory:
    simulator = Simulator.build(problem, fidelity=Fidelity(timestep_s=step_s, integrator="implicitfast"))
    time = simulator.clock(0.5)
    return simulator.play(time, np.full((len(time), 2), 0.5))


def test_a_joint_with_damping_has_the_slope_already(twins: rigs.Make) -> None:
    with pytest.raises(GaitoptError, match=r"servo_back_emf: not applicable: .*servo_damping scales it"):
        Simulator.build(twins(joint='damping="0.02"').with_effects(lost(0.05)))


# --- damping of the servo's own -----------------------------------------------------------------


def test_a_servo_s_own_damping_is_scaled_with_its_joint_s(twins: rigs.Make) -> None:
    problem = twins(joint='damping="0.02"', servo='kv="0.3"')
    effects: Effects = {"servo_damping": {"scale": 0.5, "target": "turn"}}
    model = Simulator.build(problem.with_effects(effects)).models[0]
    assert model.dof_damping == pytest.approx([0.01, 0.02])
    assert model.actuator_biasprm[:, 2] == pytest.approx([-0.15, -0.3])
    assert model.actuator_biasprm[:, 1] == pytest.approx([-20.0, -20.0])


def test_damping_of_a_servo_alone_may_be_far_less(twins: rigs.Make) -> None:
    """Where the joint has damping, the range is that of joints; without any, there is nothing to scale."""
    servo_s = nominal_parts(twins(servo='kv="0.3"'))
    joint_s = nominal_parts(twins(joint='damping="0.02"', servo='kv="0.3"'))
    assert DAMPING.bounds(servo_s) == (0.02, 4.0)
    assert DAMPING.bounds(joint_s) == (DAMPING.low, DAMPING.high) == (0.2, 4.0)
    assert DAMPING.log_prior(0.05, servo_s) > -4.0 > DAMPING.log_prior(0.05, joint_s)
    assert DAMPING.log_prior(1.0, joint_s) == 0.0
    assert "neither" in str(DAMPING.why_not(nominal_parts(twins())))
    shown = {row.name: row for row in effect_rows(servo_s)}["servo_damping"]
    assert shown.bounds == (0.02, 4.0)
    assert "feedback of speed" in shown.prior_source


def test_less_damping_of_a_servo_lets_it_overshoot(twins: rigs.Make) -> None:
    """kp = 20 and kv = 0.3 N m s/rad on 1e-3 kg m^2 are a damping ratio of 1.06."""
    problem = twins(servo='kv="0.3"')
    for scale, overshoots in ((1.0, False), (0.2, True)):
        effects: Effects = {"servo_damping": {"scale": scale, "target": "turn"}}
        path = rigs.hold(problem, 0.02, 0.5, **effects)
        assert (path["joint.wheel"].max() > 0.021) == overshoots
        assert path["joint.idler"].max() < 0.021
