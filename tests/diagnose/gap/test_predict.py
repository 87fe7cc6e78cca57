"""Predictions: one rollout for each distinct drive, the same bits wherever it runs."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
import pytest
from drives import wandering

from gaitopt.diagnose.gap.predict import latest_gait_time, predict, predict_each, predict_runs, runs_of
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.drive import Drive
from gaitopt.optimise.executors import SerialExecutor, open_executor, working
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.tolerances import SmallErrors


@pytest.fixture(scope="module")
def robot(strider: Problem) -> Simulator:
    """The strider with nominal friction, and with less."""
    return Simulator.build(strider, (Scenario(), Scenario(SmallErrors(friction=(0.9,) * 3))))


def trial(drive: Drive, seconds: float) -> Trial:
    """A trial of a drive; what was measured does not matter to its prediction."""
    time = np.arange(0.0, seconds, 0.05)
    return replace(Trial.of("trial", drive, time, {"marker.y": np.sin(time)}), starts_at_s=0.0)


@pytest.fixture(scope="module")
def trials(robot: Simulator) -> list[Trial]:
    """Two trials of one gait, the longer one second, and one of a log of commands."""
    gait = next(iter(robot.problem.baselines.values()))
    log = wandering(len(robot.problem.channel_names), 3.0)
    return [trial(gait, 2.0), trial(replace(gait, name="again"), 2.5), trial(log, 2.0)]


def bits(rows: list[list[Trajectory]]) -> list[bytes]:
    """The bits of some trajectories."""
    return [series.tobytes() for row in rows for one in row for series in (one.time, *one.signals.values())]


def run(robot: Simulator, trials: list[Trial], executor: Executor) -> list[list[Trajectory]]:
    """Both scenarios of a robot, on an executor."""
    with working(executor):
        return predict_each([(robot, 0), (robot, 1)], trials, executor)


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_predictions_have_the_same_bits_wherever_they_run(
    robot: Simulator, trials: list[Trial], executor: str
) -> None:
    expected = run(robot, trials, SerialExecutor())
    assert [one.status for row in expected for one in row] == ["ok"] * 6
    assert bits(run(robot, trials, open_executor(executor, 2))) == bits(expected)
    runs = runs_of(trials)
    named = dict(zip(runs, predict_runs(robot, list(runs.values()), ["marker.y"]), strict=True))
    assert bits([[named[one.drive.key] for one in trials]]) == bits(
        [[replace(path, signals={"marker.y": path["marker.y"]}) for path in expected[0]]]
    )
    assert bits(expected[:1]) != bits(expected[1:])


def test_trials_of_one_drive_share_the_longest_rollout(robot: Simulator, trials: list[Trial]) -> None:
    first, second, third = predict(robot, trials, SerialExecutor())
    assert first is second
    assert first.time[-1] == pytest.approx(latest_gait_time(trials[1]), abs=2e-3)
    assert third.time[-1] == pytest.approx(latest_gait_time(trials[2]), abs=2e-3)
