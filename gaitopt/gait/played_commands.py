"""Commands as a player sends them: whole pulse widths where a servo is calibrated, angles elsewhere."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.calibration import Calibration
from gaitopt.gait.logged import LoggedCommands

Cell = int | float | None
"""A pulse width, µs, or an angle, rad; None where the servo is unpowered."""


@dataclass(frozen=True)
class PlayedCommands:
    """A table of commands that can be played.

    Attributes:
        commands: the commands that the cells mean.
        units: unit of each channel, ``us`` or ``rad``.
        rows: what is sent, a row for each of `commands.time`.
    """

    commands: LoggedCommands
    units: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]

    @staticmethod
    def of(commands: LoggedCommands, servos: Mapping[str, Calibration]) -> PlayedCommands:
        """Return commands as they are sent; pulses are rounded, and stay within what the servo takes."""
        columns = [
            _column(targets, servos[name])
            for name, targets in zip(commands.channels, commands.rows.T, strict=True)
        ]
        angles = [
            _angles(column, servos[name]) for name, column in zip(commands.channels, columns, strict=True)
        ]
        units = tuple("us" if servos[name].is_calibrated else "rad" for name in commands.channels)
        meant = replace(commands, rows=np.stack(angles, axis=-1))
        return PlayedCommands(meant, units, tuple(zip(*columns, strict=True)))

    @property
    def columns(self) -> tuple[str, ...]:
        """Name of each column in a table: the channel and the unit."""
        return tuple(f"{name}_{unit}" for name, unit in zip(self.commands.channels, self.units, strict=True))

    @property
    def in_pulses(self) -> bool:
        """Whether every channel is in µs."""
        return set(self.units) == {"us"}

    def to_csv(self) -> str:
        """Return a log of commands as data sets have it: ``t_s`` and a column for each channel."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["t_s", *self.columns])
        for stamp, row in zip(self.commands.time.tolist(), self.rows, strict=True):
            writer.writerow([repr(stamp), *("" if cell is None else repr(cell) for cell in row)])
        return text.getvalue()


def _column(targets: NDArray[np.float64], servo: Calibration) -> list[Cell]:
    """Return what is sent to a servo, shape (n,)."""
    return [None if math.isnan(target) else _cell(target, servo) for target in targets.tolist()]


def _cell(target: float, servo: Calibration) -> Cell:
    if not servo.is_calibrated:
        return target
    return min(max(round(servo.pulse_us(math.degrees(target))), servo.min_us), servo.max_us)


def _angles(column: list[Cell], servo: Calibration) -> NDArray[np.float64]:
    """Return the targets that cells mean, rad, shape (n,)."""
    numbers = np.array([math.nan if cell is None else cell for cell in column], dtype=float)
    if not servo.is_calibrated:
        return numbers
    return np.deg2rad([servo.angle_deg(pulse) for pulse in numbers.tolist()])
