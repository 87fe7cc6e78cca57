"""What is sent to the servos: a drive's targets, what they hold before it, and sampling by servo frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.drive import Commands, Drive
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets
from gaitopt.simulation.scenario import Scenario

_FRAME_EDGE = 1e-9
"""Frames: a time this close before a frame counts as after it."""

_BEFORE = 1e-6
"""Steps: a time this close before 0 counts as 0."""


def servo_commands(
    problem: Problem,
    drive: Drive,
    time: NDArray[np.float64],
    framed: bool = False,
    held: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return what is sent to each actuator, rad, shape (n, nu).

    Args:
        problem: the problem.
        drive: what is commanded, its channels in the problem's order.
        time: gait times, s, shape (n,).
        framed: as a servo gets it: the targets at the start of a frame act from the next frame on, and
            before that `held`.
        held: what the servos hold before the drive, rad, shape (nu,); the start's targets by default.
    """
    if not framed:
        return drive.targets(time)
    frame_s = problem.file.servo.frame_s
    frame = np.floor(time / frame_s + _FRAME_EDGE)
    sent = drive.targets((frame - 1.0) * frame_s)
    held = start_targets(problem) if held is None else held
    return np.where((frame < 1.0)[:, None], held, sent)


def drive_commands(
    problem: Problem,
    drive: Drive,
    scenario: Scenario,
    step_s: float,
    held: NDArray[np.float64] | None = None,
) -> Commands:
    """Return what is sent in a scenario at any gait time.

    Args:
        problem: the problem.
        drive: what is commanded.
        scenario: whether servo frames count, and each servo's zero error.
        step_s: step of the simulation, s.
        held: what the servos hold before gait time 0, rad, shape (nu,); the start's targets by default.
    """
    held, trim = start_targets(problem) if held is None else held, scenario.errors.servo_trim_rad

    def sent(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = servo_commands(problem, drive, time, scenario.framed, held)
        before = time < -_BEFORE * step_s
        if before.any():
            rows = np.where(before[:, None], held, rows)
        return rows + trim if trim else rows

    return sent


def row_commands(
    problem: Problem, time: NDArray[np.float64], rows: NDArray[np.float64], step_s: float
) -> Commands:
    """Return what is sent at any time where each step has a row: before the first, the start's targets.

    Args:
        problem: the problem.
        time: times of the rows, s, shape (n,).
        rows: commands, rad, shape (n, nu).
        step_s: step of the simulation, s.
    """
    held = start_targets(problem)

    def sent(at: NDArray[np.float64]) -> NDArray[np.float64]:
        if at is time:
            return rows
        row = np.rint((at - time[0]) / step_s).astype(int)
        return np.where((row < 0)[:, None], held, rows[np.clip(row, 0, len(time) - 1)])

    return sent
