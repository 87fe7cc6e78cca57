"""Predictions of a set of trials: one rollout for each distinct drive, as long as its longest trial."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from gaitopt.diagnose.gap.align import longest_offset
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.drive import Drive
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


def predict(simulator: Simulator, trials: Sequence[Trial], executor: Executor) -> list[Trajectory]:
    """Return the nominal prediction of each trial, from gait time 0; trials of one drive share a rollout."""
    return predict_each([(simulator, 0)], trials, executor)[0]


def predict_each(
    robots: Iterable[tuple[Simulator, int]], trials: Sequence[Trial], executor: Executor
) -> list[list[Trajectory]]:
    """Return the prediction of each trial by each robot; all rollouts are submitted at once.

    Args:
        robots: simulators, each with the index of its scenario.
        trials: the trials.
        executor: where rollouts run.

    Returns:
        For each robot a list in the order of the trials.
    """
    runs = runs_of(trials)
    rows = [
        {
            key: executor.submit(observed_rollout, simulator, run.drive, scenario, run.duration_s)
            for key, run in runs.items()
        }
        for simulator, scenario in robots
    ]
    return [[row[trial.drive.key].result() for trial in trials] for row in rows]


def observed_rollout(simulator: Simulator, drive: Drive, scenario: int, duration: float) -> Trajectory:
    """Return a rollout as it would be measured: a unit of work that may run in another process.

    Args:
        simulator: the robot.
        drive: the commands.
        scenario: index of the simulator's scenario.
        duration: length, s.
    """
    return simulator.observe(simulator.run(drive, scenario, duration))


def latest_gait_time(trial: Trial) -> float:
    """Return the latest gait time at which a trial may end, s."""
    latest = longest_offset(trial) if trial.starts_at_s is None else trial.starts_at_s
    return max(float(trial.time[-1]) + latest, trial.drive.block_s)


@dataclass(frozen=True)
class Run:
    """What a robot is to do.

    Attributes:
        drive: the commands.
        duration_s: length, s.
    """

    drive: Drive
    duration_s: float


def runs_of(trials: Sequence[Trial], latest_s: Sequence[float] | None = None) -> dict[str, Run]:
    """Return the distinct runs of some trials by the drive's key, each as long as its longest trial needs.

    Args:
        trials: the trials.
        latest_s: the latest gait time of each, s; by default the latest that it may have.
    """
    runs: dict[str, Run] = {}
    for trial, latest in zip(trials, latest_s or [latest_gait_time(trial) for trial in trials], strict=True):
        key = trial.drive.key
        if key not in runs or latest > runs[key].duration_s:
            runs[key] = Run(trial.drive, latest)
    return runs


def predict_runs(simulator: Simulator, runs: Sequence[Run], signals: Sequence[str]) -> list[Trajectory]:
    """Return runs as they would be measured, only the named signals, so that little is sent back."""
    paths = [observed_rollout(simulator, run.drive, 0, run.duration_s) for run in runs]
    return [
        Trajectory(path.time, {name: path[name].copy() for name in signals}, path.status) for path in paths
    ]
