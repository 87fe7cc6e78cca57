"""Predictions of a set of trials: one rollout for each distinct drive, as long as its longest trial."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor

from gaitopt.diagnose.record.dataset import Trial
from gaitopt.gait.drive import Drive
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


def predict(simulator: Simulator, trials: Sequence[Trial], executor: Executor) -> list[Trajectory]:
    """Return the nominal prediction of each trial, from gait time 0; trials of one drive share a rollout."""
    return predict_each([(simulator, 0)], trials, executor)[0]


def predict_each(
    robots: Iterable[tuple[Simulator, int]], trials: Sequence[Trial], executor: Executor
) -> list[list[Trajectory]]:
    """Return the prediction of each trial by each robot, all rollouts at once.

    Args:
        robots: simulators, each with the index of its scenario.
        trials: the trials.
        executor: where rollouts run.

    Returns:
        For each robot a list in the order of the trials.
    """
    keys = [trial.drive.key for trial in trials]
    durations: dict[str, float] = {}
    drives: dict[str, Drive] = {}
    for key, trial in zip(keys, trials, strict=True):
        durations[key] = max(durations.get(key, 0.0), latest_gait_time(trial))
        drives[key] = trial.drive
    rows = [
        {key: executor.submit(_measured, simulator, drives[key], scenario, durations[key]) for key in drives}
        for simulator, scenario in robots
    ]
    return [[row[key].result() for key in keys] for row in rows]


def _measured(simulator: Simulator, drive: Drive, scenario: int, duration: float) -> Trajectory:
    """Return a rollout as it would be measured."""
    return simulator.observe(simulator.run(drive, scenario, duration))


def latest_gait_time(trial: Trial) -> float:
    """Return the latest gait time at which a trial may end, s."""
    latest = trial.drive.block_s if trial.starts_at_s is None else trial.starts_at_s
    return max(float(trial.time[-1]) + latest, trial.drive.block_s)
