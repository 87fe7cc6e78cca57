"""Predictions of a set of trials: one rollout for each distinct drive, as long as its longest trial."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor

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
    rollouts = _rollouts(trials)
    rows = [
        {
            key: executor.submit(observed_rollout, simulator, drive, scenario, duration)
            for key, (drive, duration) in rollouts.items()
        }
        for simulator, scenario in robots
    ]
    return [[row[trial.drive.key].result() for trial in trials] for row in rows]


def predictions(simulator: Simulator, trials: Sequence[Trial]) -> list[Trajectory]:
    """Return the prediction of each trial by one robot in its first scenario, simulated in this thread."""
    done = {
        key: observed_rollout(simulator, drive, 0, duration)
        for key, (drive, duration) in _rollouts(trials).items()
    }
    return [done[trial.drive.key] for trial in trials]


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
    latest = trial.drive.block_s if trial.starts_at_s is None else trial.starts_at_s
    return max(float(trial.time[-1]) + latest, trial.drive.block_s)


def _rollouts(trials: Sequence[Trial]) -> dict[str, tuple[Drive, float]]:
    """Return each distinct drive and the time that its longest trial needs, s, by the drive's key."""
    rollouts: dict[str, tuple[Drive, float]] = {}
    for trial in trials:
        key, latest = trial.drive.key, latest_gait_time(trial)
        _, longest = rollouts.get(key, (trial.drive, 0.0))
        rollouts[key] = trial.drive, max(longest, latest)
    return rollouts
