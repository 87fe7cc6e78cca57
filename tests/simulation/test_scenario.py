"""Scenarios: draws of friction, strength, servo zeros and start pose."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from helpers import still

from gaitopt.core.streams import Stream
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario, draw_scenarios
from gaitopt.simulation.tolerances import SmallErrors


def test_the_same_seed_draws_the_same_scenarios(arcfold: Problem) -> None:
    assert draw_scenarios(arcfold, 5, (3, 1)) == draw_scenarios(arcfold, 5, (3, 1))
    assert draw_scenarios(arcfold, 5, (3, 1)) != draw_scenarios(arcfold, 5, (4, 1))
    assert len(set(draw_scenarios(arcfold, 5, (3, 1)))) == 5


def test_the_streams_share_no_scenario(arcfold: Problem) -> None:
    """The scenarios of the verification are different from those of the search."""
    streams = [
        set(scenarios_of(arcfold, 1, stream))
        for stream in (Stream.SEARCH_SCENARIOS, Stream.SELECTION_SCENARIOS, Stream.VERIFICATION_SCENARIOS)
    ]
    spread = arcfold.file.scenarios
    assert (len(streams[0]), len(streams[2])) == (spread.search, spread.verification)
    assert not streams[0] & streams[1]
    assert not streams[0] & streams[2]
    assert not streams[1] & streams[2]


def test_scenarios_are_robots_that_the_tolerances_allow(arcfold: Problem) -> None:
    tolerances = arcfold.file.tolerances
    drawn = draw_scenarios(arcfold, 400, (1,))
    trims = np.degrees([scenario.errors.servo_trim_rad for scenario in drawn])
    assert trims.shape == (400, 3)
    assert np.std(trims) == pytest.approx(tolerances.servo_trim_deg, rel=0.1)
    assert {scenario.start_pose_rad for scenario in drawn} == {tolerances.start_pose_rad}
    assert [scenario.framed for scenario in drawn] == [False] * 399 + [True]


def test_a_robot_with_errors_starts_where_it_rests_itself(arcfold: Problem) -> None:
    """A trim turns the servo before the gait begins, not with a jerk at its start."""
    trimmed = Scenario(SmallErrors(servo_trim_rad=(0.05, 0.0, 0.0)))
    simulator = Simulator.build(arcfold, (NOMINAL, trimmed))
    nominal, moved = (simulator.run(still(arcfold), i, duration=0.2)["joint.mid_left"] for i in range(2))
    assert moved[0] - nominal[0] == pytest.approx(0.05, abs=0.01)
    assert np.ptp(moved) < 1e-3


def test_no_scenario_is_framed_where_the_problem_says_so() -> None:
    published = load_problem("arcfold-published")
    assert not any(scenario.framed for scenario in draw_scenarios(published, 5, (1,)))


def test_a_friction_scenario_scales_the_robots_geoms_alone(strider: Problem) -> None:
    nominal, slippery = Simulator.build(strider, (NOMINAL, Scenario(SmallErrors(friction=(0.5,) * 3)))).models
    for i in range(nominal.ngeom):
        scaled = nominal.geom(i).name in {"rear_foot", "front_foot", "trunk"}
        factor = 0.5 if scaled else 1.0
        np.testing.assert_array_equal(slippery.geom_friction[i], factor * nominal.geom_friction[i])
    assert slippery.actuator_forcerange.tolist() == nominal.actuator_forcerange.tolist()


def test_a_servo_scenario_scales_the_torque_limit_alone(strider: Problem) -> None:
    nominal, weak = Simulator.build(
        strider, (NOMINAL, Scenario(SmallErrors(servo_strength=(0.8, 0.8))))
    ).models
    np.testing.assert_array_equal(weak.actuator_forcerange, 0.8 * nominal.actuator_forcerange)
    assert weak.actuator_gainprm.tolist() == nominal.actuator_gainprm.tolist()
    assert weak.geom_friction.tolist() == nominal.geom_friction.tolist()


def starts(problem: Problem, spread: float, read: Callable[[Mapping[str, np.ndarray]], float]) -> np.ndarray:
    """One figure of the first sample, over many disturbed starts."""
    scenarios = tuple(Scenario(start_pose_rad=spread, pose_seed=seed) for seed in range(60))
    simulator = Simulator.build(problem, scenarios)
    gait = still(problem)
    return np.array([read(simulator.run(gait, i, duration=0.0).signals) for i in range(60)])


def test_start_poses_are_disturbed_by_the_spread(strider: Problem) -> None:
    assert np.ptp(starts(strider, 0.0, lambda s: s["joint.rear_hip"][0])) == 0.0
    hips = starts(strider, 0.01, lambda s: s["joint.rear_hip"][0])
    assert np.std(hips) == pytest.approx(0.01, rel=0.3)


def test_a_start_pose_in_rad_moves_no_slide(strider: Problem) -> None:
    """An error of an angle does not lift the robot or press it into the ground."""
    assert np.ptp(starts(strider, 0.01, lambda s: s["joint.above"][0])) == 0.0
    assert np.ptp(starts(strider, 0.01, lambda s: s["joint.along"][0])) == 0.0


def test_a_free_robot_is_turned_about_up(arcfold: Problem) -> None:
    yaw = starts(arcfold, 0.01, lambda s: 2.0 * math.atan2(s["heading.z"][0], s["heading.w"][0]))
    assert np.std(yaw) == pytest.approx(0.01, rel=0.3)
    tilt = starts(arcfold, 0.01, lambda s: math.hypot(s["heading.x"][0], s["heading.y"][0]))
    assert np.abs(tilt).max() < 1e-3
