"""A robot's weight and its servos' limits."""

import math
from pathlib import Path

import mujoco
import pytest
from helpers import STRIDER

from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator


@pytest.fixture(scope="module")
def model(arcfold: Problem) -> mujoco.MjModel:
    return build_model(arcfold)


def speed(problem: Problem, gait: str) -> float:
    """Forward speed of a baseline on the nominal robot."""
    simulator = Simulator.build(problem)
    trajectory = simulator.run(problem.baselines[gait])
    assert trajectory.status == "ok"
    robot = Robot.of(simulator.models[0])
    return measure(problem, problem.baselines[gait], trajectory, robot)["speed_m_s"]


@pytest.mark.parametrize("robot", ["arcfold", "arcfold-published", STRIDER])
def test_the_weight_is_the_whole_robots(robot: Path | str) -> None:
    model = build_model(load_problem(robot))
    assert Robot.of(model).weight == pytest.approx(model.body_mass.sum() * 9.81, rel=1e-12)


def test_a_servos_no_load_speed_is_its_torque_over_its_damping(strider: Problem) -> None:
    robot = Robot.of(build_model(strider.with_parameters({"torque_limit": 0.5, "b_servo": 0.1})))
    assert robot.torque_limit.tolist() == [0.5, 0.5]
    assert robot.no_load_speed == pytest.approx([5.0, 5.0])
    undamped = Robot.of(build_model(strider.with_parameters({"b_servo": 0.0})))
    assert undamped.no_load_speed.tolist() == [math.inf, math.inf]


def test_a_servo_turns_at_its_no_load_speed(strider: Problem) -> None:
    """In the air, with no load on the leg, the motor's speed uses up its torque."""
    model = build_model(strider.with_parameters({"torque_limit": 0.02, "b_servo": 0.01, "k_servo": 50.0}))
    model.opt.gravity[:] = 0.0
    model.geom_contype[:] = 0
    data = mujoco.MjData(model)
    data.ctrl[:] = 100.0
    mujoco.mj_step(model, data, 500)
    assert data.actuator_velocity == pytest.approx(Robot.of(model).no_load_speed, rel=1e-3)
