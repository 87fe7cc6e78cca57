"""The measured marker in a film of a simulation: a ghost beside the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import DataSet
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import LoggedCommands
from gaitopt.robot.signals import AXES, MARKER, marker_signal
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class Ghost:
    """Where the marker was measured, in the simulation's world and on its clock.

    Attributes:
        trial: the trial's name.
        time: gait times, s, shape (n,), rising.
        positions: the marker there, m, shape (n, 3); an axis that was not measured is the simulation's.
    """

    trial: str
    time: NDArray[np.float64]
    positions: NDArray[np.float64]

    def before(self, at: float, window: float) -> NDArray[np.float64]:
        """Return the positions of the last `window` s up to a gait time, the newest last, shape (k, 3)."""
        first, last = np.searchsorted(self.time, (at - window, at), side="right")
        return self.positions[first:last] if at <= self.time[-1] + window else self.positions[:0]


def ghost_of(simulator: Simulator, trial: Trial, trajectory: Trajectory) -> Ghost:
    """Return the marker of a trial beside a rollout of the trial's drive.

    The origin of a recording is unknown. So the ghost starts at the simulated marker's mean position over its
    first block, and a difference in speed is seen as a growing distance.

    Args:
        simulator: the robot that was simulated.
        trial: the trial.
        trajectory: what its drive makes, from gait time 0 to the recording's end or beyond.

    Raises:
        GaitoptError: the trial has no marker, or the simulation failed.
    """
    observed = simulator.observe(trajectory)
    aligned = align(clean(trial).trial, observed)
    positions = np.stack([np.interp(aligned.time, observed.time, observed[name]) for name in MARKER], axis=1)
    measured = [axis for axis in AXES if marker_signal(axis) in aligned.residual]
    if not measured:
        raise GaitoptError(f"trial {trial.name}: no marker was measured, so there is none to show")
    for axis in measured:
        residual = aligned.residual[marker_signal(axis)]
        early = residual[aligned.time <= aligned.time[0] + trial.drive.block_s]
        origin = float(np.nanmean(early)) if np.isfinite(early).any() else 0.0
        positions[:, AXES.index(axis)] += residual - origin
    seen = np.isfinite(positions).all(axis=1)
    return Ghost(trial.name, aligned.time[seen], positions[seen])


def trial_of(dataset: DataSet, drive: Drive) -> Trial:
    """Return the first trial of a gait or of a log, wherever its joints started.

    Raises:
        GaitoptError: there is none.
    """
    for trial in dataset.trials:
        if _commands_of(trial.drive) == _commands_of(drive):
            return trial
    there = ", ".join(dict.fromkeys(trial.drive.name for trial in dataset.trials))
    raise GaitoptError(f"{dataset.source}: no trial of {drive.name}; allowed: a gait measured there: {there}")


def _commands_of(drive: Drive) -> str:
    return drive.commands_key if isinstance(drive, LoggedCommands) else drive.key
