"""Effects of camera, tracker and clock on a known path."""

import math

import numpy as np
import pytest

from gaitopt.effects.active import Values
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

TIME = np.arange(0.0, 4.0, 0.01)
PATH = Trajectory(
    TIME,
    {
        "marker.x": 0.05 * TIME,
        "marker.y": 0.01 * TIME,
        "marker.z": 0.02 + 0.0 * TIME,
        "joint.mid_left": np.sin(TIME),
    },
)


def seen(problem: Problem, seed: int = 0, **effects: Values) -> Trajectory:
    return Simulator.build(problem.with_effects(effects)).observe(PATH, seed)


def test_a_scale_multiplies_lengths_and_no_angles(arcfold: Problem) -> None:
    measured = seen(arcfold, camera_scale={"scale": 1.1})
    assert measured["marker.x"] == pytest.approx(1.1 * PATH["marker.x"])
    assert measured["marker.y"] == pytest.approx(1.1 * PATH["marker.y"])
    assert measured["joint.mid_left"] is PATH["joint.mid_left"]


def test_a_tilt_makes_a_level_path_climb(arcfold: Problem, strider: Problem) -> None:
    angle = 0.1
    measured = seen(arcfold, camera_tilt={"angle_rad": angle})
    assert np.diff(measured["marker.z"]) == pytest.approx(0.0005 * math.sin(angle))
    assert np.diff(measured["marker.x"]) == pytest.approx(0.0005 * math.cos(angle))
    assert measured["marker.y"] == pytest.approx(PATH["marker.y"])
    along_y = seen(strider, camera_tilt={"angle_rad": angle})
    assert np.diff(along_y["marker.z"]) == pytest.approx(0.0001 * math.sin(angle))


def test_clocks_change_time_and_nothing_else(arcfold: Problem) -> None:
    late = seen(arcfold, clock_offset={"offset_s": 0.3})
    assert np.interp(1.0, late.time, late["marker.x"]) == pytest.approx(0.05 * 1.3)
    assert seen(arcfold, clock_rate={"rate": 1.02}).time == pytest.approx(1.02 * TIME)
    rounded = seen(arcfold, clock_rounding={"grid_s": 0.1}).time
    assert np.abs(rounded - TIME).max() <= 0.05 + 1e-12
    assert np.unique(np.round(rounded, 9)) == pytest.approx(np.arange(0.0, 4.05, 0.1))
    assert late["marker.x"] is PATH["marker.x"]


def test_outliers_hit_their_share_of_samples_and_come_again_with_the_seed(arcfold: Problem) -> None:
    measured = seen(arcfold, marker_outliers={"share": 0.2})
    moved = measured["marker.x"] != PATH["marker.x"]
    assert moved.mean() == pytest.approx(0.2, abs=0.06)
    assert np.array_equal(moved, measured["marker.z"] != PATH["marker.z"])
    assert measured["marker.y"] == pytest.approx(PATH["marker.y"], abs=1e-12), "a camera at the side"
    jump = np.hypot(measured["marker.x"] - PATH["marker.x"], measured["marker.z"] - PATH["marker.z"])[moved]
    assert jump.min() > 0.02
    assert np.array_equal(seen(arcfold, marker_outliers={"share": 0.2})["marker.x"], measured["marker.x"])
    other = seen(arcfold, seed=1, marker_outliers={"share": 0.2})
    assert not np.array_equal(other["marker.x"], measured["marker.x"])


def test_a_simulation_is_of_the_robot_and_not_of_its_film(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-1s"]
    simulator = Simulator.build(arcfold.with_effects({"camera_scale": {"scale": 1.1}}))
    true = Simulator.build(arcfold).run(gait, duration=0.3)
    filmed = simulator.run(gait, duration=0.3)
    assert np.array_equal(filmed["marker.x"], true["marker.x"])
    assert simulator.observe(filmed)["marker.x"] == pytest.approx(1.1 * true["marker.x"])


def test_a_coordinate_that_was_not_measured_stays_absent(arcfold: Problem) -> None:
    flat = Trajectory(TIME, {"marker.x": PATH["marker.x"]})
    simulator = Simulator.build(arcfold.with_effects({"camera_scale": {"scale": 2.0}}))
    assert list(simulator.observe(flat).signals) == ["marker.x"]
