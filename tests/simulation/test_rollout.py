"""Rollouts: the same bits on every executor, exact commands, scenarios, and failures as data."""

import csv
import math
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from drives import wandering
from helpers import same_bits, still

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator, judge
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.signals import UNITS, kind_of
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.commands import servo_commands
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.objective import FAILED_COST
from gaitopt.simulation.rollout import RolloutSettings, Simulator
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

    def run(pair: tuple[Gait, int]) -> Trajectory:
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


@pytest.mark.parametrize("command", [-math.inf, math.inf, 1e300])
def test_rollouts_after_a_divergence_are_unaffected(strider: Problem, command: float) -> None:
    simulator = Simulator.build(strider)
    gait = strider.baselines["square"]
    expected = simulator.run(gait)
    time = simulator.clock(1.0)
    assert simulator.play(time, np.full((len(time), 2), command)).status.startswith("diverged")
    assert same_bits(simulator.run(gait), expected)


def test_the_robot_of_each_scenario_walks_alone_as_among_the_others(strider: Problem) -> None:
    scenarios = draw_scenarios(strider, 3, (1,))
    together, gait = Simulator.build(strider, scenarios), strider.baselines["square"]
    for index, alone in enumerate(together.split()):
        assert alone.scenarios == (scenarios[index],)
        assert same_bits(alone.run(gait, duration=1.0), together.run(gait, index, duration=1.0))
        built = Simulator.build(strider, (scenarios[index],))
        assert same_bits(alone.run(gait, duration=1.0), built.run(gait, duration=1.0))


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


def test_a_drive_without_a_period_is_simulated_for_as_long_as_it_lasts(strider: Problem) -> None:
    simulator, drive = Simulator.build(strider), wandering(2, 0.75)
    trajectory = simulator.run(drive)
    assert simulator.duration(drive) == 0.75
    assert trajectory.status == "ok"
    assert trajectory.time[-1] == pytest.approx(0.75)
    np.testing.assert_array_equal(trajectory.stacked("target"), drive.targets(trajectory.time))
    time = simulator.clock(0.75)
    assert same_bits(simulator.play(time, drive.targets(time)), trajectory)


def test_a_rollout_too_long_to_simulate_is_one_line(strider: Problem) -> None:
    simulator = Simulator.build(strider, settings=RolloutSettings(max_steps=100))
    allowed = "allowed: a rollout of at most 0.2 s"
    with pytest.raises(GaitoptError, match=f"^square: period_s: found 0.4; {allowed}$"):
        simulator.run(strider.baselines["square"])
    with pytest.raises(GaitoptError, match=f"^log: duration: found 0.75; {allowed}$"):
        simulator.run(wandering(2, 0.75))


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
