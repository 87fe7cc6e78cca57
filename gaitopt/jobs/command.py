"""The job `command`: what is sent to each actuator."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import csv_text, write_text
from gaitopt.gait.drive import Drive
from gaitopt.jobs.inputs import found_drive
from gaitopt.jobs.outputs import writing
from gaitopt.problem.model import build_model, carrying
from gaitopt.problem.problem import Problem
from gaitopt.simulation.commands import servo_commands

_MOST_ROWS = 50_000_000


@dataclass(frozen=True)
class CommandTable:
    """What is sent to each actuator.

    Attributes:
        time: s, shape (n,).
        targets: target of each actuator by its name, in the model's order, rad, each of shape (n,); NaN where
            it is unpowered.
    """

    time: NDArray[np.float64]
    targets: dict[str, NDArray[np.float64]]

    def to_csv(self) -> str:
        """Return the table as CSV, with shortest round-trip floats; blank where a servo is unpowered."""
        return csv_text({"t_s": self.time} | self.targets, nan="")


def command(
    problem: Problem, gait: Drive | str | Path, *, dt: float, duration: float, out: Path | str | None = None
) -> CommandTable:
    """Return what a gait or a log of commands sends to each actuator at t = 0, dt, … < duration.

    Args:
        problem: the problem.
        gait: a gait or other commands, what `Problem.find_gait` finds by name or path, or a log of commands.
        dt: time between rows, s.
        duration: rows end before this, s.
        out: where to write the table as CSV.

    Raises:
        GaitoptError: a time is not positive, there would be too many rows, or the gait does not fit.
    """
    for name, value in (("dt", dt), ("duration", duration)):
        if not (math.isfinite(value) and value > 0.0):
            raise GaitoptError(f"--{name}: found {value}; allowed: a positive number of seconds")
    ratio = duration / dt * (1.0 - 1e-12)
    if not ratio <= _MOST_ROWS:
        raise GaitoptError(f"--dt: found {dt:g}; allowed: at most 50 million rows, not {ratio:.3g}")
    with writing(problem, out):
        problem = carrying(problem)
        build_model(problem)  # the channels are the model's actuators in order
        time: NDArray[np.float64] = np.arange(math.ceil(ratio), dtype=np.float64) * dt
        targets = servo_commands(problem, found_drive(problem, gait), time)
        table = CommandTable(time, dict(zip(problem.channel_names, targets.T, strict=True)))
        if out is not None:
            write_text(Path(out), table.to_csv())
    return table
