"""Where the trials of a log begin: repeats share one drive with one measured start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.logged import LoggedCommands
from gaitopt.robot.signals import kind_of, name_of

_SAME_START_RAD = 0.1
"""Trials of the same commands are repeats if no joint starts further apart than this, rad.

Repeats on a bench start within 0.005 rad of one another, robots that are put down by hand within a few
hundredths.
"""

_EARLY_S = 0.25
"""A recording that begins later than this after the log does not show where the joints started, s."""


@dataclass(frozen=True)
class _Family:
    """Trials that share a drive.

    Attributes:
        numbers: their places in the data set.
        starts: measured start of each of them, rad by joint.
    """

    numbers: list[int]
    starts: list[Mapping[str, float]]

    def has(self, start: Mapping[str, float]) -> bool:
        """Return whether another trial starts at the same angles, as far as both were measured."""
        first = self.starts[0]
        return all(abs(start[joint] - first[joint]) <= _SAME_START_RAD for joint in start if joint in first)

    @property
    def start(self) -> dict[str, float] | None:
        """Mean start of the trials, rad by joint; None where no joint was measured."""
        joints = dict.fromkeys(joint for start in self.starts for joint in start)
        return {
            joint: float(np.mean([start[joint] for start in self.starts if joint in start]))
            for joint in joints
        } or None


def shared_starts(trials: Sequence[Trial]) -> list[Trial]:
    """Return trials in which the repeats of a log share one drive, which knows where the joints started.

    Repeats command the same from about the same joint angles. Their drive starts at the mean of their first
    measured angles, and lasts as long as their longest recording. Trials of gaits stay as they are.
    """
    families: dict[str, list[_Family]] = {}
    for number, trial in enumerate(trials):
        if isinstance(trial.drive, LoggedCommands):
            start, known = measured_start(trial), families.setdefault(trial.drive.commands_key, [])
            family = next((family for family in known if family.has(start)), None)
            if family is None:
                known.append(_Family([number], [start]))
            else:
                family.numbers.append(number)
                family.starts.append(start)
    shared = list(trials)
    for family in (family for known in families.values() for family in known):
        drive = _shared_drive([trials[number] for number in family.numbers], family.start)
        for number in family.numbers:
            shared[number] = replace(trials[number], drive=drive)
    return shared


def measured_start(trial: Trial) -> dict[str, float]:
    """Return the angle of each measured joint when the log begins, rad; empty where it was not measured."""
    early = trial.starts_at_s is None or trial.time[0] + trial.starts_at_s <= _EARLY_S
    joints = [signal for signal in trial.signals if kind_of(signal) == "joint"] if early else []
    return {name_of(signal): float(trial.counted(signal)[1][0]) for signal in joints}


def _shared_drive(trials: Sequence[Trial], start: Mapping[str, float] | None) -> LoggedCommands:
    """Return the drive of repeats of one log."""
    (drive, *_) = (trial.drive for trial in trials if isinstance(trial.drive, LoggedCommands))
    ends = [float(trial.time[-1]) + trial.frame_s + (trial.starts_at_s or 0.0) for trial in trials]
    return drive.recorded(max(ends), max(trial.frame_s for trial in trials), start)
