"""A data set: a folder of measured trials, read in SI units and checked."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from gaitopt.core.errors import GaitoptError, bad_value, found, unknown_name
from gaitopt.core.files import found_inside, inside, read_toml
from gaitopt.core.units import ANGLE, LENGTH, TIME, suffix_scale
from gaitopt.core.validation import PLAIN_NUMBER, Name, validated
from gaitopt.diagnose.record.commands import read_commands
from gaitopt.diagnose.record.starts import shared_starts
from gaitopt.diagnose.record.tables import TextTable, read_csv
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import SAMPLES_PER_BLOCK, LoggedCommands
from gaitopt.gait.table import read_gait_file
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import is_position, kind_of, site_of, site_signals

DATASET_FILE = "dataset.toml"

_KINDS = ("marker", "joint", "site")
"""Kinds of signals that can be measured."""

WHOLE_CYCLES = 2
"""A trial of a gait has at least this many cycles, so that differences between them can be seen."""

_Finite = Annotated[float, Field(allow_inf_nan=False), PLAIN_NUMBER]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False), PLAIN_NUMBER]
_UNKNOWN = "unknown"


def _known_or_not(value: object) -> object:
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if value is not None and value != _UNKNOWN and not number:
        raise ValueError(f'found {found(value)}; allowed: a number of seconds, or "{_UNKNOWN}"')
    return value


_Start = Annotated[float | Literal["unknown"] | None, BeforeValidator(_known_or_not)]
_Name = Annotated[Name, Field(min_length=1, max_length=100)]


class TrialFile(BaseModel):
    """One ``[[trial]]`` of a data set's file.

    It has either `gait` or `commands`.

    Attributes:
        name: what reports call the trial.
        gait: a baseline's name, or a gait file or an exported table in the data set's folder.
        commands: a log of commands in the same folder (see `read_commands`). It may be the recording's file.
        channels: column of each channel in that log, where it is not called after the channel.
        file: CSV file in the same folder.
        time: column of the time stamps; its unit is its suffix.
        starts_at_gait_time_s: gait time at the recording's zero; ``unknown`` where it is not known, as is the
            default for a gait. For commands it is the time of the log's clock at the recording's zero, and
            0 by default: both have one clock.
        noise_m: standard deviation of the marker's noise, where it is known; 0 is as none.
        fps: frame rate of the recording, where it is known.
        signals: column of each signal measured.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: _Name
    gait: _Name | None = None
    commands: _Name | None = None
    channels: dict[Name, Name] = Field(default_factory=dict)
    file: _Name
    time: _Name = "t_s"
    starts_at_gait_time_s: _Start = None
    noise_m: Annotated[float, Field(ge=0.0, allow_inf_nan=False), PLAIN_NUMBER] | None = None
    fps: _Positive | None = None
    signals: Annotated[dict[Name, Name], Field(min_length=1)]

    @model_validator(mode="after")
    def _one_drive(self) -> TrialFile:
        if (self.gait is None) == (self.commands is None):
            raise ValueError("allowed: either `gait` or `commands`, not both")
        if self.channels and self.commands is None:
            raise ValueError("channels: found without `commands`; allowed: columns of a log of commands")
        return self

    @property
    def starts_at_s(self) -> float | None:
        """Time of the gait or of the log at the recording's zero, s; None where it is not known."""
        if self.starts_at_gait_time_s is None:
            return None if self.commands is None else 0.0
        return None if self.starts_at_gait_time_s == _UNKNOWN else float(self.starts_at_gait_time_s)


class DataSetFile(BaseModel):
    """The content of ``dataset.toml``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    trial: Annotated[list[TrialFile], Field(min_length=1)]


@dataclass(frozen=True)
class DataSet:
    """A checked data set.

    Attributes:
        source: the file ``dataset.toml``.
        trials: the trials in the order of the file.
    """

    source: Path
    trials: tuple[Trial, ...]

    @property
    def sites(self) -> list[str]:
        """The sites that were measured."""
        names = [name for trial in self.trials for name in trial.signals if kind_of(name) == "site"]
        return list(dict.fromkeys(map(site_of, names)))


def load_dataset(folder: Path, problem: Problem, known: Collection[str]) -> DataSet:
    """Return the data set in a folder.

    Args:
        folder: the folder that holds ``dataset.toml``, or the file.
        problem: the problem whose robot was measured.
        known: signals that the robot has; see `measurable_signals`. Those that cannot be measured do not
            count.

    Raises:
        GaitoptError: a file, key, column, unit, signal, channel or gait is wrong, or a recording goes back
            in time or is shorter than two cycles of its gait.
    """
    path = found_inside(folder, DATASET_FILE) if folder.is_dir() else folder
    if path is None or not path.is_file():
        raise GaitoptError(f"{folder}: no {DATASET_FILE} there")
    file = validated(DataSetFile, read_toml(path), path)
    names = [entry.name for entry in file.trial]
    repeated = next((name for name, count in Counter(names).items() if count > 1), None)
    if repeated is not None:
        raise GaitoptError(f"{path}: trial {repeated!r} appears twice; allowed: one of each name")
    measurable = sorted(name for name in known if kind_of(name) in _KINDS)
    trials = [_trial(entry, path, problem, measurable) for entry in file.trial]
    return DataSet(path, tuple(shared_starts(trials)))


def _trial(entry: TrialFile, path: Path, problem: Problem, measurable: list[str]) -> Trial:
    source = f"{path}: trial {entry.name}"
    drive = _drive(entry, path, problem, source)
    for signal in entry.signals:
        if signal not in measurable:
            raise _unknown_signal(signal, measurable, source)
    table = read_csv(_beside(path, entry.file, f"{source}: file"))
    time = _time(table, entry, drive, source)
    signals = {name: _series(table, name, column, source) for name, column in entry.signals.items()}
    used = {name: np.isfinite(series) for name, series in signals.items()}
    starts = entry.starts_at_s
    if isinstance(drive, LoggedCommands) and starts is not None:
        starts -= drive.first_s
    elif isinstance(drive, LoggedCommands):  # its clock may have begun at any time, even years ago
        time = time - time[0]
    return Trial(entry.name, drive, time, signals, used, starts, entry.noise_m, entry.fps)


def _unknown_signal(signal: str, measurable: Sequence[str], source: str) -> GaitoptError:
    """Return the error for a signal that the robot does not have."""
    sites = list(dict.fromkeys(site_of(name) for name in measurable if kind_of(name) == "site"))
    if kind_of(signal) == "site" and signal.count(".") > 1 and site_of(signal) not in sites:
        return unknown_name(source, "site", site_of(signal), sites)
    if kind_of(signal) == "site" and site_of(signal) in sites:
        return unknown_name(source, "signal", signal, site_signals(site_of(signal)))
    others = [name for name in measurable if kind_of(name) != "site"]
    return unknown_name(source, "signal", signal, [*others, *(["site.NAME.x"] if sites else [])])


def _drive(entry: TrialFile, path: Path, problem: Problem, source: str) -> Drive:
    """Return a trial's log of commands, or its gait: a baseline's, or one in a file beside the data set's."""
    if entry.commands is not None:
        log = _beside(path, entry.commands, f"{source}: commands")
        return read_commands(log, problem, entry.channels, entry.time)
    reference = str(entry.gait)
    if reference in problem.baselines:
        return problem.baselines[reference]
    if not (path.parent / reference).is_file():
        known = [*problem.baselines, "a gait file beside the data set's"]
        raise unknown_name(source, "gait", reference, known)
    file = _beside(path, reference, f"{source}: gait")
    return problem.check_gait(read_gait_file(file), file)


def _beside(path: Path, name: str, key: str) -> Path:
    """Return a file in the data set's folder."""
    file = inside(path.parent, name)
    if file is None:
        raise bad_value(key, "path", name, "a file in the data set's folder")
    if not file.is_file():
        raise GaitoptError(f"{key}: {file}: no such file")
    return file


def _time(table: TextTable, entry: TrialFile, drive: Drive, source: str) -> Series:
    """Return the time stamps, s, shape (n,), after they were checked."""
    time = table.column(entry.time) * suffix_scale(source, "time", entry.time, TIME)
    blank = np.flatnonzero(~np.isfinite(time))
    if len(blank):
        raise GaitoptError(f"{table.source}: line {table.first_line + blank[0]}: {entry.time} is missing")
    backward = np.flatnonzero(np.diff(time) < 0.0)
    if len(backward):
        line, at = table.first_line + backward[0] + 1, time[backward[0] :]
        raise GaitoptError(f"{table.source}: line {line}: time goes backward, from {at[0]:g} to {at[1]:g} s")
    _check_length(time, f"{table.source}", entry.time, drive)
    return time


def _check_length(time: Series, source: str, column: str, drive: Drive) -> None:
    """Check that a recording has enough cycles, and enough samples a cycle; or, of a log, enough samples."""
    steps = np.diff(time)
    frame = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    period = drive.period_s
    if period is None:
        if (steps > 0.0).sum() < SAMPLES_PER_BLOCK - 1:
            raise GaitoptError(f"{source}: found {len(time)} samples; allowed: {SAMPLES_PER_BLOCK} or more")
        return
    if time[-1] - time[0] + frame < WHOLE_CYCLES * period * (1.0 - 1e-9):
        raise GaitoptError(f"{source}: {time[-1] - time[0]:.4g} s are fewer than two cycles of {period:g} s")
    if frame > period / SAMPLES_PER_BLOCK:
        raise GaitoptError(
            f"{source}: {column}: samples {frame:.4g} s apart are fewer than {SAMPLES_PER_BLOCK} "
            f"a cycle of {period:g} s; are they milliseconds?"
        )


def _series(table: TextTable, signal: str, column: str, source: str) -> Series:
    """Return a measured signal, m or rad, shape (n,); NaN where its cell is blank."""
    if column not in table.head:
        raise unknown_name(f"{source}: signals.{signal}: {table.source}", "column", column, table.head)
    units = LENGTH if is_position(signal) else ANGLE
    series = table.column(column) * suffix_scale(source, f"signals.{signal}", column, units)
    measured = np.isfinite(series)
    if measured.sum() < SAMPLES_PER_BLOCK:
        found = "no number" if not measured.any() else f"numbers in {measured.sum()} rows"
        raise GaitoptError(
            f"{table.source}: column {column}: found {found}; allowed: {SAMPLES_PER_BLOCK} or more"
        )
    series[~measured] = np.nan
    if kind_of(signal) == "site" and not is_position(signal):  # as the simulation gives it
        series[measured] = _unwrapped(series[measured])
    return series


def _unwrapped(angles: Series) -> Series:
    """Return angles without jumps of a turn, the first between -pi and pi, rad, shape (n,)."""
    turns: Series = np.unwrap(angles)
    return turns - 2.0 * math.pi * round(float(turns[0]) / (2.0 * math.pi))
