"""Importing: exports of tracking programs and logs of robots are turned into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import ArrayLike

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import csv_text, write_text
from gaitopt.core.folders import check_new_or_empty, filled
from gaitopt.core.validation import validated
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.columns import PULSE
from gaitopt.diagnose.record.commanded import Commanded, commanded
from gaitopt.diagnose.record.dataset import DATASET_FILE, WHOLE_CYCLES, DataSetFile
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import Export, ImportOptions, Motion, Sent
from gaitopt.diagnose.record.importers import IMPORTERS
from gaitopt.diagnose.record.lerobot import INFO, is_lerobot
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import measured_column_of, unit_of


@dataclass(frozen=True)
class Imported:
    """One recording in SI units.

    Attributes:
        name: name of the trial.
        source: the file or folder that it came from.
        program: the program or format.
        time: time stamps, s, shape (n,).
        signals: series by signal, m or rad, each of shape (n,).
        defects: what is wrong with the recording, and what was changed.
        sent: the commands, where the file holds some.
        zero_s: stamp of the file's own clock that is zero in `time`, s.
        sync_at_s: stamp at which the gait began, s, and
        fps: frames a second, where the file shows them.
    """

    name: str
    source: Path
    program: str
    time: Series
    signals: Mapping[str, Series]
    defects: tuple[Defect, ...]
    sent: Sent | None = None
    zero_s: float = 0.0
    sync_at_s: float | None = None
    fps: float | None = None

    @property
    def channels(self) -> list[str]:
        """The channels that are commanded in the file."""
        return [] if self.sent is None else [name.rpartition("_")[0] for name in self.sent.columns]


@dataclass(frozen=True)
class Recording:
    """One recording as it was read.

    Attributes:
        source: the file or folder that it came from.
        program: the program or format.
        motion: what is in it.
    """

    source: Path
    program: str
    motion: Motion

    @property
    def trial(self) -> Trial:
        """The recording as a trial whose commands are not known."""
        motion = self.motion
        return Trial.of(motion.name or self.source.stem, UnknownDrive(), motion.time, motion.signals)


@dataclass(frozen=True)
class UnknownDrive:
    """Unknown commands of an export; only a block length is assumed, to judge defects."""

    name: str = ""
    key: str = "unknown"
    period_s: None = None
    block_s: float = 1.0
    duration_s: None = None
    start: None = None

    def targets(self, t: ArrayLike) -> Series:
        """Raise an error: the targets are not known."""
        raise GaitoptError("the commands of an export are not known before it is part of a data set")


def import_file(path: Path, options: ImportOptions) -> Imported:
    """Return the recording in a file that holds one; see `import_path`."""
    (recording,) = import_path(path, options)
    return recording


def import_path(path: Path, options: ImportOptions) -> list[Imported]:
    """Return the recordings in an export, a log or a LeRobot data set; see `read_path`."""
    return [_imported(recording, UnknownDrive()) for recording in read_path(path, options)]


def read_path(path: Path, options: ImportOptions) -> list[Recording]:
    """Return the recordings in an export, a log or a LeRobot data set, as they are read.

    Raises:
        GaitoptError: it is of no format of `IMPORTERS`, or an option that it needs is missing.
    """
    options.check()
    export = Export(path, options)
    if path.is_dir() and not is_lerobot(path):
        raise GaitoptError(f"{path}: found a folder; allowed: a file, or a LeRobot data set with {INFO}")
    if path.suffix == ".parquet":
        raise GaitoptError(
            f"{path}: found a table of a data set; allowed: the data set's folder, with {INFO}"
        )
    importer = next((importer for importer in IMPORTERS if importer.recognises(export)), None)
    if importer is None:
        raise GaitoptError(
            f"{path}: not an export of Tracker, DeepLabCut, SLEAP or Kinovea, nor a CSV table with a time "
            "column such as t_s"
        )
    if not importer.maps and (options.commands or options.signals):
        raise GaitoptError(
            f"{path}: {importer.program}: takes no --command and no --signal; allowed: for logs"
        )
    read = importer.read(export)
    motions = [read] if isinstance(read, Motion) else read
    recordings = [Recording(path, importer.program, motion) for motion in motions]
    for recording in recordings:
        _check_time(recording)
    return recordings


def _imported(recording: Recording, drive: Drive) -> Imported:
    """Return a recording with what is wrong with it, under the gait that was commanded if it holds none."""
    motion, trial = recording.motion, recording.trial
    if motion.sent is not None:
        log = _log_of(motion.sent)
        trial = replace(trial, drive=log, starts_at_s=-log.first_s)
    elif drive.period_s is not None and np.ptp(trial.time) >= WHOLE_CYCLES * drive.period_s:
        trial = replace(trial, drive=drive)
    defects = (*motion.defects, *clean(trial).defects)
    return Imported(
        trial.name, recording.source, recording.program, trial.time, trial.signals, defects, motion.sent,
        motion.zero_s, motion.sync_at_s, motion.fps,
    )  # fmt: skip


def _log_of(sent: Sent) -> LoggedCommands:
    """Return the commands as angles, of servos as their datasheet has them: to judge defects alone."""
    servo = Calibration()
    angles = [
        np.deg2rad((np.where(column > 0.0, column, np.nan) - servo.neutral_us) / servo.us_per_deg)
        if name.endswith(f"_{PULSE}")
        else column
        for name, column in sent.columns.items()
    ]
    return LoggedCommands.of(list(sent.columns), sent.time, np.stack(angles, axis=-1))


def _check_time(recording: Recording) -> None:
    path, trial = recording.source, recording.trial
    if np.isnan(trial.time).any():
        raise GaitoptError(f"{path}: {int(np.isnan(trial.time).sum())} time stamps are missing")
    backward = np.flatnonzero(np.diff(trial.time) < 0.0)
    if len(backward):
        raise GaitoptError(f"{path}: time goes backward after {trial.time[backward[0]]:g} s")
    if not any(used.any() for used in trial.used.values()) or len(np.unique(trial.time)) < 3:
        raise GaitoptError(f"{path}: fewer than three samples")


def import_files(
    files: Sequence[Path],
    gaits: Sequence[str],
    folder: Path,
    options: ImportOptions,
    problem: Problem | None = None,
) -> list[Imported]:
    """Write a data set of some files; nothing is written unless all of them can be read.

    Args:
        files: exports and logs, each a trial named after its file, and LeRobot data sets, a trial an episode.
        gaits: what was commanded where a file does not say it: one for all of these files, or one for each;
            see `commanded`.
        folder: the new data set.
        options: what the files do not say themselves.
        problem: the problem that the gaits are checked with, if it is known.

    Raises:
        GaitoptError: the folder is not empty, a file cannot be imported, or a gait is wrong, missing or too
            many.
    """
    check_new_or_empty(folder)
    read = [recording for path in files for recording in read_path(path, options)]
    return write_recordings(read, gaits, folder, options, problem)


def write_recordings(
    read: Sequence[Recording],
    gaits: Sequence[str],
    folder: Path,
    options: ImportOptions,
    problem: Problem | None = None,
) -> list[Imported]:
    """Write a data set of some recordings, each a trial; for the arguments see `import_files`.

    Raises:
        GaitoptError: the folder is not empty, or a gait is wrong, missing or too many.
    """
    check_new_or_empty(folder)
    each = _gait_of_each(read, gaits, options, problem)
    drives: list[Drive] = [UnknownDrive() if gait is None else gait.gait for gait in each]
    imported = [_imported(recording, drive) for recording, drive in zip(read, drives, strict=True)]
    _check_names(imported)
    taken = {DATASET_FILE, *(f"{name}.csv" for recording in imported for name in _tables_of(recording))}
    entries = []
    with filled(folder) as place:
        for recording, gait in zip(imported, each, strict=True):
            beside = None if gait is None else gait.beside(place, taken)
            entries.append(_write_trial(place, recording, beside, options))
        content = {"trial": entries}
        write_text(place / DATASET_FILE, tomli_w.dumps(content))
        validated(DataSetFile, content, folder / DATASET_FILE)
    return imported


def _gait_of_each(
    recordings: Sequence[Recording], gaits: Sequence[str], options: ImportOptions, problem: Problem | None
) -> list[Commanded | None]:
    """Return the gait of each recording; None for those that hold their commands."""
    silent = [recording for recording in recordings if recording.motion.sent is None]
    if silent and not gaits:
        raise GaitoptError(
            f"{silent[0].source}: holds no commands, such as target.NAME_rad; say what was commanded: "
            "--gait GAIT, or --command CHANNEL=COLUMN"
        )
    if gaits and not silent:
        raise GaitoptError("--gait: found one, and every file holds its commands; allowed: none")
    if options.sync_at_s is not None and len(silent) < len(recordings):
        raise GaitoptError(
            "--sync-at: found one for a log of commands, which has their clock; allowed: for gaits"
        )
    if silent and len(gaits) not in (1, len(silent)):
        raise GaitoptError(f"--gait: found {len(gaits)} for {len(silent)} files; allowed: one, or one each")
    found = {gait: commanded(gait, problem) for gait in gaits}
    own = iter(list(gaits) * len(silent) if len(gaits) == 1 else gaits)
    return [found[next(own)] if recording.motion.sent is None else None for recording in recordings]


def _check_names(imported: Sequence[Imported]) -> None:
    """Check that no file of the data set would have the name of another."""
    names = [name for recording in imported for name in _tables_of(recording)]
    if len(set(names)) < len(names):
        raise GaitoptError(f"two files have the same name: {', '.join(sorted(names))}")


def _tables_of(recording: Imported) -> list[str]:
    """Return the names of a trial's tables, without their suffix."""
    return [recording.name, *([f"{recording.name}-commands"] if recording.sent else [])]


def _write_trial(
    folder: Path, recording: Imported, gait: str | None, options: ImportOptions
) -> dict[str, object]:
    """Write the tables of a trial; return its entry in the data set's file."""
    name, *others = _tables_of(recording)
    signals = {signal: measured_column_of(signal) for signal in recording.signals}
    if len(set(signals.values())) < len(signals):  # a joint called as the angle of a site
        signals = {signal: f"{signal}_{unit_of(signal)}" for signal in signals}
    columns = {"t_s": recording.time} | {signals[n]: series for n, series in recording.signals.items()}
    _write_table(folder / f"{name}.csv", columns)
    entry: dict[str, object] = {"name": name}
    if recording.sent is not None:
        entry["commands"] = f"{others[0]}.csv"
        _write_table(folder / f"{others[0]}.csv", {"t_s": recording.sent.time, **recording.sent.columns})
    else:
        entry["gait"] = gait
    entry |= {"file": f"{name}.csv", "time": "t_s"}
    sync_at_s = options.sync_at_s if recording.sync_at_s is None else recording.sync_at_s
    if sync_at_s is not None:
        entry["starts_at_gait_time_s"] = recording.zero_s - sync_at_s
    fps = options.fps if recording.fps is None else recording.fps
    if fps is not None:
        entry["fps"] = fps
    return entry | {"signals": signals}


def _write_table(path: Path, columns: dict[str, Series]) -> None:
    """Write a table, with a blank cell for each NaN."""
    head, end, rows = csv_text(columns).partition("\n")
    write_text(path, head + end + rows.replace("nan", ""))
