"""Logs of commands: a column of time stamps, and a target of each servo, held until the next row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from gaitopt.core.errors import GaitoptError, nearest, unknown_name
from gaitopt.core.units import ANGLE, TIME, suffix_scale
from gaitopt.diagnose.record.defect import Defect, Found
from gaitopt.diagnose.record.settings import DefectSettings
from gaitopt.diagnose.record.tables import TextTable, read_csv
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem

PULSE = "us"
"""Unit of a pulse width: it becomes an angle through the servo's calibration."""

COMMAND_UNITS = {**ANGLE, PULSE: 1e-6}
"""Units of columns of commands, by suffix."""


def read_commands(
    path: Path, problem: Problem, columns: Mapping[str, str] | None = None, time: str | None = None
) -> LoggedCommands:
    """Return the commands in a log.

    A column is ``NAME_rad``, ``NAME_deg`` or ``NAME_us`` (pulse width, through the calibration of the
    channel's servo), NAME being the channel. A blank cell means that the servo is unpowered, as does a pulse
    width of 0. Targets beyond the servo's travel are kept. What `gaitopt command` writes is such a log, too,
    and so is what `gaitopt simulate` writes.

    Args:
        path: a CSV table.
        problem: the problem, for its channels.
        columns: columns by channel, where they are not called after the channel.
        time: column of the time stamps; ``t_s`` or ``t_ms`` where the table has no such column.

    Raises:
        GaitoptError: the file is no such table, a channel has no column, or time does not rise.
    """
    columns = dict(columns or {})
    table = read_csv(path)
    if table.head == ("t_s", *problem.channel_names):  # what `gaitopt command` writes
        table = replace(table, head=("t_s", *(f"{name}_rad" for name in problem.channel_names)))
    for channel in columns:
        if channel not in problem.file.channels:
            raise unknown_name(f"{path}: channels", "channel", channel, problem.channel_names)
    stamps = _stamps(table, time)
    named = {name: columns.get(name) or _column_of(table, name) for name in problem.channel_names}
    rows = np.stack([_targets(table, problem, *pair) for pair in named.items()], axis=-1)
    ranges = np.deg2rad([bounds.range_deg for bounds in problem.file.channels.values()])
    return LoggedCommands.of(problem.channel_names, stamps, rows, path.stem, ranges=ranges)


def commands_beyond_range(trial: Trial, _: DefectSettings) -> Found:
    """Find targets beyond the servos' travel. They are kept: this is what was sent."""
    drive = trial.drive
    beyond = drive.beyond_range if isinstance(drive, LoggedCommands) else {}
    if not beyond or not isinstance(drive, LoggedCommands) or drive.ranges is None:
        return trial, None
    ranges = dict(zip(drive.channels, drive.ranges.tolist(), strict=True))
    parts = [
        f"{name} from {low:.4g} to {high:.4g} rad (its servo goes from {ranges[name][0]:.4g} to "
        f"{ranges[name][1]:.4g})"
        for name, (low, high) in beyond.items()
    ]
    message = f"commands beyond the servo's travel, kept as they were sent: {'; '.join(parts)}"
    return trial, Defect("commands_beyond_range", trial.name, message)


def _stamps(table: TextTable, time: str | None) -> Series:
    """Return the time of each row, s, shape (n,), after it was checked."""
    names = [name for name in (time, "t_s", "t_ms") if name is not None]
    column = next((name for name in names if name in table.head), None)
    if column is None:
        raise unknown_name(table.source, "column", names[0], table.head)
    stamps: Series = table.column(column) * suffix_scale(table.source, "time", column, TIME)
    blank = np.flatnonzero(~np.isfinite(stamps))
    if len(blank):
        raise GaitoptError(f"{table.source}: line {table.first_line + blank[0]}: {column} is missing")
    late = np.flatnonzero(np.diff(stamps) <= 0.0)
    if len(late):
        line, at = table.first_line + late[0] + 1, stamps[late[0] :]
        raise GaitoptError(
            f"{table.source}: line {line}: time does not rise, from {at[0]:g} to {at[1]:g} s; allowed: one "
            "row of commands at a time"
        )
    return stamps


def _column_of(table: TextTable, channel: str) -> str:
    """Return the column of a channel."""
    possible = [f"{channel}_{unit}" for unit in COMMAND_UNITS]
    present = [name for name in (*possible, f"target.{channel}_rad") if name in table.head]
    if len(present) == 1:
        return present[0]
    if present:
        raise GaitoptError(f"{table.source}: found columns {' and '.join(present)}; allowed: one of them")
    raise GaitoptError(
        f"{table.source}: no column of channel {channel}; allowed: {', '.join(possible)}; found: "
        f"{', '.join(table.head)}{nearest(possible[0], table.head)}"
    )


def _targets(table: TextTable, problem: Problem, channel: str, column: str) -> Series:
    """Return the targets of a channel, rad, shape (n,); NaN where it is unpowered."""
    if column not in table.head:
        raise unknown_name(f"{table.source}: channels.{channel}", "column", column, table.head)
    scale = suffix_scale(table.source, f"channels.{channel}", column, COMMAND_UNITS)
    numbers = table.column(column)
    if column.endswith(f"_{PULSE}"):
        servo = problem.file.channels[channel].servo
        degrees = [servo.angle_deg(pulse) if pulse else np.nan for pulse in numbers.tolist()]
        numbers, scale = np.array(degrees), ANGLE["deg"]
    targets: Series = np.where(np.isfinite(numbers), numbers * scale, np.nan)
    return targets
