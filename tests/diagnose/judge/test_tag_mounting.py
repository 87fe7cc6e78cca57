"""Tags are never glued exactly where a problem file says: the diagnosis expects that."""

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator


def frame(model: mujoco.MjModel, site: str) -> tuple[Rotation, NDArray[np.float64]]:
    """Turn and place of a site while no joint is turned."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = data.site(site)
    return Rotation.from_matrix(found.xmat.reshape(3, 3)), found.xpos.copy()


def test_tags_that_are_observed_are_misplaced_by_their_tolerances(arcfold: Problem) -> None:
    simulator = Simulator.build(arcfold.observing(["base_tag", "tail_tag"]))
    turn, place = frame(simulator.models[0], "tail_tag")
    found = [frame(robot.models[0], "tail_tag") for robot in perturbed_robots(simulator, 1, 40)]
    away = np.array([p - place for _, p in found])
    turned = np.array([(turn.inv() * t).as_rotvec() for t, _ in found])
    assert np.std(away) == pytest.approx(0.6e-3, rel=0.25)
    assert np.std(turned) == pytest.approx(math.radians(0.6), rel=0.25)


def test_the_marker_moves_with_the_tag_that_measures_it(arcfold: Problem) -> None:
    marker = str(arcfold.roles.marker)
    simulator = Simulator.build(arcfold.observing(["base_tag", "tail_tag"]))
    turn, place = frame(simulator.models[0], "tail_tag")
    _, point = frame(simulator.models[0], marker)
    beside = turn.inv().apply(point - place)
    for robot in perturbed_robots(simulator, 1, 3):
        glued, there = frame(robot.models[0], "tail_tag")
        assert glued.inv().apply(frame(robot.models[0], marker)[1] - there) == pytest.approx(beside)


def test_without_tags_in_the_data_nothing_changes(arcfold: Problem) -> None:
    simulator = Simulator.build(arcfold)
    for robot in perturbed_robots(simulator, 1, 3):
        assert (robot.models[0].site_pos == simulator.models[0].site_pos).all()
