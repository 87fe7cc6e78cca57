"""Rollouts: the same bits wherever they run, honest commands, scenarios, and failures as data."""

import csv
import math
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers import same_bits, still

from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator, judge
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.problem.start import start_targets
from gaitopt.robot.signals import UNITS, kind_of
from gaitopt.simulation.commands import servo_commands
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.objective import FAILED_COST
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario, draw_scenarios
from gaitopt.simulation.setup import RobotSetup

EXPLODING = {"k_servo": 1e7, "torque_limit": 1e12}
"""Parameters with which the strider's simulation diverges at the first motion."""


def gaits(problem: Problem, count: int) -> list[Gait]:
    """The baselines and random gaits."""
    rng = np.random.default_rng(7)
    points = rng.uniform(size=(count, len(problem.space.variables)))
    return [*problem.baselines.values(), *(problem.space.decode(point) for point in points)]


# --- the same bits ----------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["quick", "strider"])
def test_every_executor_gives_the_same_bits(robot: str, request: pytest.FixtureRequest) -> None:
    problem = request.getfixturevalue(robot)
    setting = RobotSetup.of(problem, draw_scenarios(problem, 2, (1,)), problem.simulation.working)
    asked = gaits(problem, 3)
    with open_executor("serial") as executor:
        expected = Evaluator(setting, executor).outcomes(asked)
    assert len(expected) == len(asked)
    assert {len(row) for row in expected} == {2}
    for workers in (1, 2, 3):
        with open_executor("threads", workers) as executor:
            assert repr(Evaluator(setting, executor).outcomes(asked)) == repr(expected)


def test_processes_give_the_same_bits(strider: Problem) -> None:
    setting = RobotSetup.of(strider, draw_scenarios(strider, 2, (1,)), strider.simulation.working)
    asked = gaits(strider, 2)
    with open_executor("serial") as serial, open_executor("processes", 2) as processes:
        expected = Evaluator(setting, serial).outcomes(asked)
        assert repr(Evaluator(setting, processes).outcomes(asked)) == repr(expected)


def test_threads_share_one_simulator(strider: Problem) -> None:
    simulator = Simulator.build(strider, draw_scenarios(strider, 3, (1,)))
    asked = [(gait, scenario) for gait in gaits(strider, 5) for scenario in range(3)]
    expected = [simulator.run(gait, scenario) for gait, scenario in asked]
    fresh = Simulator.build(strider, simulator.scenarios)
    threads = set()

    def run(pair: tuple[Gait, int]) -> object:
        threads.add(threading.get_ident())
        return fresh.run(*pair)

    with ThreadPoolExecutor(3) as executor:
        found = list(executor.map(run, asked))
    assert len(threads) > 1
    assert all(same_bits(one, other) for one, other in zip(expected, found, strict=True))


def test_a_rollout_does_not_remember_the_one_before(quick: Problem) -> None:
    simulator = Simulator.build(quick)
    one, other = list(quick.baselines.values())[:2]
    first = simulator.run(one, duration=1.0)
    simulator.run(other, duration=2.0)
    assert same_bits(simulator.run(one, duration=1.0), first)
    assert same_bits(Simulator.build(quick).run(one, duration=1.0), first)


# --- failures are data ------------------------------------------------------------------------


def test_a_simulation_that_diverges_says_so(strider: Problem, capfd: pytest.CaptureFixture[str]) -> None:
    simulator = Simulator.build(strider.with_parameters(EXPLODING))
    gait = strider.baselines["square"]
    trajectory = simulator.run(gait)
    assert trajectory.status.startswith("diverged: bad")
    metrics = measure(strider, gait, trajectory, Robot.of(simulator.models[0]))
    assert all(math.isnan(value) for value in metrics.values())
    assert "\n" not in trajectory.status
    assert capfd.readouterr() == ("", "")  # MuJoCo itself would print a warning per rollout
    assert list(Path().iterdir()) == []  # and keep a log file


@pytest.mark.parametrize("command", [math.nan, math.inf, 1e300])
def test_rollouts_after_a_divergence_are_unaffected(strider: Problem, command: float) -> None:
    simulator = Simulator.build(strider)
    gait = strider.baselines["square"]
    expected = simulator.run(gait)
    time = simulator.clock(1.0)
    assert simulator.play(time, np.full((len(time), 2), command)).status.startswith("diverged")
    assert same_bits(simulator.run(gait), expected)


def test_a_failed_scenario_fails_the_gait(strider: Problem) -> None:
    broken = strider.with_parameters(EXPLODING)
    with open_executor("serial") as executor:
        setting = RobotSetup.of(broken, (NOMINAL, NOMINAL), broken.simulation.working)
        evaluator = Evaluator(setting, executor)
        one = evaluator([broken.baselines["square"]])[0]
        evaluation, outcomes = one.evaluation, one.outcomes
        rest = evaluator([still(broken)])[0].evaluation
    assert evaluation.cost == FAILED_COST
    assert evaluation.status == outcomes[0].status != "ok"
    assert not evaluation.constraints_met
    assert rest.status == "ok"
    assert judge(broken, [outcomes[0]]).status == evaluation.status


# --- commands ---------------------------------------------------------------------------------


def test_framed_commands_are_held_for_a_frame_and_come_one_frame_late(quick: Problem) -> None:
    gait = quick.baselines["square-1s"].with_period(0.9871)
    frame_s = quick.file.servo.frame_s
    time = np.arange(2000) * 1e-3
    sent = servo_commands(quick, gait, time, framed=True)
    frame = np.round(time * 1e6).astype(int) // round(frame_s * 1e6)
    assert frame.max() > 50
    assert (sent[frame == 0] == start_targets(quick)).all()
    for number in range(1, frame.max() + 1):
        in_frame = sent[frame == number]
        assert (in_frame == in_frame[0]).all()
        assert in_frame[0] == pytest.approx(gait.targets([(number - 1) * frame_s])[0], abs=1e-12)
    unframed = servo_commands(quick, gait, time)
    np.testing.assert_array_equal(unframed, gait.targets(time))
    assert (unframed != sent).any()


def test_before_the_first_frame_the_start_is_held(strider: Problem) -> None:
    held = strider.file.start.model_copy(update={"ctrl_deg": {"rear": 7.0}})
    problem = Problem.from_file(
        strider.file.model_copy(update={"start": held}), strider.source, strider.model_path
    )
    sent = servo_commands(problem, problem.baselines["square"], np.array([0.0, 0.0199, 0.02]), framed=True)
    assert sent[:2] == pytest.approx(np.deg2rad([[7.0, 0.0], [7.0, 0.0]]))
    assert sent[2] == pytest.approx(problem.baselines["square"].targets([0.0])[0])


def test_the_trajectory_says_what_was_commanded(strider: Problem) -> None:
    gait = strider.baselines["stride"]
    for framed in (False, True):
        simulator = Simulator.build(strider, (Scenario(framed=framed),))
        trajectory = simulator.run(gait)
        expected = servo_commands(strider, gait, trajectory.time, framed)
        np.testing.assert_array_equal(trajectory.stacked("target"), expected)


def test_a_square_wave_switches_the_servo_in_its_very_step(strider: Problem) -> None:
    """The torque at a sample already answers to the target of that sample."""
    trajectory = Simulator.build(strider).run(strider.baselines["square"])
    gain = strider.file.parameters["k_servo"].value
    limit = strider.file.parameters["torque_limit"].value
    error = trajectory["target.rear"] - trajectory["position.rear"]
    expected = np.clip(gain * error, -limit, limit)
    np.testing.assert_allclose(trajectory["torque.rear"], expected, rtol=0, atol=1e-12)


# --- what is recorded -------------------------------------------------------------------------


@pytest.mark.parametrize("period_s", [0.5, 0.3333, 0.7371, 0.25013])
@pytest.mark.parametrize("timestep_s", [1e-4, 2e-4, 1e-3, 3e-3])
def test_a_trajectory_covers_its_duration(strider: Problem, period_s: float, timestep_s: float) -> None:
    fidelity = strider.simulation.working.model_copy(update={"timestep_s": timestep_s})
    simulator = Simulator.build(strider, fidelity=fidelity)
    gait = strider.baselines["stride"].with_period(period_s)
    trajectory = simulator.run(gait)
    assert trajectory.time[0] == 0.0
    assert trajectory.time[-1] >= simulator.duration(gait) * (1.0 - 1e-12)
    steps = np.diff(trajectory.time)
    assert steps == pytest.approx(max(1e-3, timestep_s), rel=1e-6)
    assert {len(series) for series in trajectory.signals.values()} == {len(trajectory.time)}


def test_every_signal_of_the_robot_is_recorded(strider: Problem) -> None:
    trajectory = Simulator.build(strider).run(strider.baselines["stride"], duration=0.1)
    assert set(trajectory.signals) == {
        *(f"marker.{axis}" for axis in "xyz"),
        *(f"heading.{part}" for part in "wxyz"),
        *("contacts", "contacts_all", "depth"),
        *(f"{kind}.rear" for kind in ("target", "position", "rate", "torque")),
        *(f"{kind}.front" for kind in ("target", "position", "rate", "torque")),
        *(f"joint.{name}" for name in ("along", "above", "pitch", "rear_hip", "front_hip")),
        *(f"{kind}.{pad}.{axis}" for kind in ("load", "pad_speed") for pad in strider.roles.pads
          for axis in "xyz"),
    }  # fmt: skip
    assert all(kind_of(name) in UNITS for name in trajectory.signals)
    assert all(np.isfinite(series).all() for series in trajectory.signals.values())


def test_the_pads_carry_the_robot(arcfold: Problem, strider: Problem) -> None:
    """At rest the loads and the contacts with the world are those of the start pose."""
    trajectory = Simulator.build(strider).run(still(strider), duration=0.5)
    weight = Robot.of(build_model(strider)).weight
    load = sum(trajectory[f"load.{pad}.z"] for pad in strider.roles.pads)
    assert load == pytest.approx(-weight, rel=1e-3)  # of the pads on the ground
    assert set(trajectory["contacts"]) == {2.0}
    assert np.array_equal(trajectory["contacts"], trajectory["contacts_all"])
    resting = Simulator.build(arcfold).run(still(arcfold), duration=0.5)
    assert resting["contacts"].min() > 0.0


def test_a_csv_has_a_unit_on_every_column_and_loses_nothing(strider: Problem) -> None:
    trajectory = Simulator.build(strider).run(strider.baselines["stride"], duration=0.2)
    rows = list(csv.DictReader(trajectory.to_csv().splitlines()))
    header = list(rows[0])
    assert header[0] == "t_s"
    for column in (
        *("marker.x_m", "heading.w", "target.rear_rad", "position.rear_rad", "rate.rear_rad_s"),
        *("torque.rear_n_m", "joint.rear_hip_rad", "load.rear_foot.z_n", "pad_speed.rear_foot.y_m_s"),
        *("contacts", "contacts_all", "depth_m"),
    ):
        assert column in header
    assert [float(row["t_s"]) for row in rows] == trajectory.time.tolist()
    for column, series in zip(header[1:], trajectory.signals.values(), strict=True):
        assert [float(row[column]) for row in rows] == series.tolist()


# --- scenarios --------------------------------------------------------------------------------


def test_the_same_seed_draws_the_same_scenarios(arcfold: Problem) -> None:
    assert draw_scenarios(arcfold, 5, (3, 1)) == draw_scenarios(arcfold, 5, (3, 1))
    assert draw_scenarios(arcfold, 5, (3, 1)) != draw_scenarios(arcfold, 5, (4, 1))
    assert len(set(draw_scenarios(arcfold, 5, (3, 1)))) == 5


def test_the_streams_share_no_scenario(arcfold: Problem) -> None:
    """What verifies a gait is nothing that the search has seen."""
    streams = [
        set(scenarios_of(arcfold, 1, stream))
        for stream in (Stream.SEARCH_SCENARIOS, Stream.SELECTION_SCENARIOS, Stream.VERIFICATION_SCENARIOS)
    ]
    spread = arcfold.file.scenarios
    assert (len(streams[0]), len(streams[2])) == (spread.search, spread.verification)
    assert not streams[0] & streams[1]
    assert not streams[0] & streams[2]
    assert not streams[1] & streams[2]


def test_scenarios_stay_inside_the_spread(arcfold: Problem) -> None:
    spread = arcfold.file.scenarios
    drawn = draw_scenarios(arcfold, 400, (1,))
    for factors, width in (
        ([scenario.friction for scenario in drawn], spread.friction),
        ([scenario.servo_strength for scenario in drawn], spread.servo_strength),
    ):
        assert 1.0 - width <= min(factors) < 1.0 - 0.9 * width
        assert 1.0 + 0.9 * width < max(factors) <= 1.0 + width
        assert np.mean(factors) == pytest.approx(1.0, abs=0.2 * width)
    assert [scenario.framed for scenario in drawn] == [False] * 399 + [True]


def test_no_scenario_is_framed_where_the_problem_says_so() -> None:
    published = load_problem("arcfold-published")
    assert not any(scenario.framed for scenario in draw_scenarios(published, 5, (1,)))


def test_a_friction_scenario_scales_the_robots_geoms_alone(strider: Problem) -> None:
    nominal, slippery = Simulator.build(strider, (NOMINAL, Scenario(friction=0.5))).models
    for i in range(nominal.ngeom):
        scaled = nominal.geom(i).name in {"rear_foot", "front_foot", "trunk"}
        factor = 0.5 if scaled else 1.0
        np.testing.assert_array_equal(slippery.geom_friction[i], factor * nominal.geom_friction[i])
    assert slippery.actuator_forcerange.tolist() == nominal.actuator_forcerange.tolist()


def test_a_servo_scenario_scales_the_torque_limit_alone(strider: Problem) -> None:
    nominal, weak = Simulator.build(strider, (NOMINAL, Scenario(servo_strength=0.8))).models
    np.testing.assert_array_equal(weak.actuator_forcerange, 0.8 * nominal.actuator_forcerange)
    assert weak.actuator_gainprm.tolist() == nominal.actuator_gainprm.tolist()
    assert weak.geom_friction.tolist() == nominal.geom_friction.tolist()


def starts(problem: Problem, spread: float, read: Callable[[dict[str, np.ndarray]], float]) -> np.ndarray:
    """A figure of the first sample over many disturbed starts."""
    scenarios = tuple(Scenario(start_pose_rad=spread, pose_seed=seed) for seed in range(60))
    simulator = Simulator.build(problem, scenarios)
    gait = still(problem)
    return np.array([read(simulator.run(gait, i, duration=0.0).signals) for i in range(60)])


def test_start_poses_are_disturbed_by_the_spread(strider: Problem) -> None:
    assert np.ptp(starts(strider, 0.0, lambda s: s["joint.rear_hip"][0])) == 0.0
    hips = starts(strider, 0.01, lambda s: s["joint.rear_hip"][0])
    assert np.std(hips) == pytest.approx(0.01, rel=0.3)


def test_a_start_pose_in_rad_moves_no_slide(strider: Problem) -> None:
    """An error of an angle is no length: the robot is neither lifted nor pressed into the ground."""
    assert np.ptp(starts(strider, 0.01, lambda s: s["joint.above"][0])) == 0.0
    assert np.ptp(starts(strider, 0.01, lambda s: s["joint.along"][0])) == 0.0


def test_a_free_robot_is_turned_about_up(arcfold: Problem) -> None:
    yaw = starts(arcfold, 0.01, lambda s: 2.0 * math.atan2(s["heading.z"][0], s["heading.w"][0]))
    assert np.std(yaw) == pytest.approx(0.01, rel=0.3)
    tilt = starts(arcfold, 0.01, lambda s: math.hypot(s["heading.x"][0], s["heading.y"][0]))
    assert np.abs(tilt).max() < 1e-3


def test_a_robot_that_is_not_to_settle_starts_where_its_file_says() -> None:
    """The published robot starts in the air, from its own keyframe."""
    published = load_problem("arcfold-published")
    trajectory = Simulator.build(published).run(published.baselines["square-1s"], duration=0.01)
    model = build_model(published)
    first = {name: series[0] for name, series in trajectory.named("joint").items()}
    expected = {name: model.key("start").qpos[model.joint(name).qposadr[0]] for name in first}
    assert first == expected
    assert any(value != 0.0 for value in expected.values())
    assert trajectory["marker.z"][-1] < trajectory["marker.z"][0]
