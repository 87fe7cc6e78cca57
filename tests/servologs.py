"""Recordings of servos that the tests make: commands, and angles as an encoder gives them."""

from __future__ import annotations

import numpy as np

from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.logged import LoggedCommands

COUNT = 2.0 * np.pi / 4096.0
"""Step of an encoder of 12 bits, rad."""


def targets(time: Series, seed: int = 1, size: float = 0.8) -> Series:
    """Random steps, one every 0.4 s, rad."""
    steps = np.random.default_rng(seed).uniform(-size, size, int(time[-1] / 0.4) + 2)
    held: Series = steps[(time / 0.4 + 1e-9).astype(int)]
    return held


def followed(time: Series, commanded: Series, lag_s: float = 0.08, late_s: float = 0.05) -> Series:
    """The angles of a servo that follows with a dead time and a lag of second order, rad."""
    fine = np.arange(time[0], time[-1] + 1e-9, 1e-3)
    asked = commanded[np.clip(np.searchsorted(time, fine - late_s, side="right") - 1, 0, None)]
    first = second = float(commanded[0])
    angles = []
    for value in asked:
        first += 1e-3 * (value - first) / (0.5 * lag_s)
        second += 1e-3 * (first - second) / (0.5 * lag_s)
        angles.append(second)
    angle: Series = np.interp(time, fine, angles)
    return angle


def log(
    seconds: float = 4.0, rate_hz: float = 50.0, step_rad: float = COUNT, seed: int = 1, size: float = 0.8
) -> Trial:
    """A servo's log: its commands, and its angle rounded to an encoder's steps."""
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    commanded = targets(time, seed, size)
    angle = followed(time, commanded)
    angle = np.round(angle / step_rad) * step_rad if step_rad else angle
    return recording(time, commanded, angle)


def recording(time: Series, commanded: Series, angle: Series) -> Trial:
    """A trial of one servo and one joint, on the clock of the log."""
    drive = LoggedCommands.of(["servo"], time, commanded[:, None])
    trial = Trial.of("log", drive, time, {"joint.arm": angle})
    return Trial(trial.name, drive, trial.time, trial.signals, trial.used, starts_at_s=0.0)
