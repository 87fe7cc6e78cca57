"""The start: at rest, and on the ground."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import STRIDER

from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.problem.start import start_targets

BOTH = ["arcfold", STRIDER]


@pytest.fixture(scope="module")
def model(arcfold: Problem) -> mujoco.MjModel:
    return build_model(arcfold)


@pytest.mark.parametrize("robot", BOTH)
def test_it_rests_at_its_start(robot: Path | str) -> None:
    problem = load_problem(robot)
    model = build_model(problem)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    np.testing.assert_array_equal(data.ctrl, start_targets(problem))
    mujoco.mj_forward(model, data)
    marker = data.site(problem.roles.marker)
    before = marker.xpos.copy()
    chunk = 10
    for _ in range(round(5.0 / (chunk * model.opt.timestep))):
        mujoco.mj_step(model, data, chunk)
        assert np.linalg.norm(marker.xpos - before) / (chunk * model.opt.timestep) < 1e-4
        assert np.abs(data.qvel[-model.nu :]).max() < 1e-3
        assert np.abs(data.qvel).max() < 1e-3
        before = marker.xpos.copy()


@pytest.mark.parametrize("robot", BOTH)
def test_the_start_stands_on_the_ground(robot: Path | str) -> None:
    problem = load_problem(robot)
    model = build_model(problem)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    force, load = np.zeros(6), 0.0
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, force)
        load += force[0]
    assert load == pytest.approx(Robot.of(model).weight, rel=1e-3)
