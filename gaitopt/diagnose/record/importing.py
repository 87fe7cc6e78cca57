"""Importing: exports of tracking programs are turned into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import ArrayLike

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import csv_text, read_bytes, write_text
from gaitopt.core.folders import check_new_or_empty, filling
from gaitopt.core.validation import validated
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import DATASET_FILE, DataSetFile
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import Export, ImportOptions
from gaitopt.diagnose.record.importers import IMPORTERS
from gaitopt.diagnose.record.tables import read_cells
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.robot.signals import measured_column_of


@dataclass(frozen=True)
class Imported:
    """One file in SI units.

    Attributes:
        program: the program that it came from.
        time: time stamps, s, shape (n,).
        signals: series by signal, m or rad, each of shape (n,).
        defects: what is wrong with the recording, and what was changed.
    """

    program: str
    time: Series
    signals: Mapping[str, Series]
    defects: tuple[Defect, ...]


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
    """Return the motion in an export of Tracker, DeepLabCut, SLEAP, Kinovea, or in a plain CSV file.

    Raises:
        GaitoptError: the file is none of these, or an option that it needs is missing.
    """
    options.check()
    rows = read_cells(path)
    importer = next((importer for importer in IMPORTERS if importer.recognises(rows)), None)
    if importer is None:
        raise GaitoptError(
            f"{path}: not an export of Tracker, DeepLabCut, SLEAP or Kinovea, nor a CSV table with a time "
            "column such as t_s"
        )
    motion = importer.read(Export(path, rows, options))
    trial = Trial.of(path.stem, UnknownDrive(), motion.time, motion.signals)
    _check_time(path, trial)
    found = clean(trial).defects
    return Imported(importer.program, trial.time, trial.signals, (*motion.defects, *found))


def _check_time(path: Path, trial: Trial) -> None:
    if np.isnan(trial.time).any():
        raise GaitoptError(f"{path}: {int(np.isnan(trial.time).sum())} time stamps are missing")
    backward = np.flatnonzero(np.diff(trial.time) < 0.0)
    if len(backward):
        raise GaitoptError(f"{path}: time goes backward after {trial.time[backward[0]]:g} s")
    if not any(used.any() for used in trial.used.values()) or len(np.unique(trial.time)) < 3:
        raise GaitoptError(f"{path}: fewer than three samples")


def import_files(
    files: Sequence[Path], gaits: Sequence[str], folder: Path, options: ImportOptions
) -> list[Imported]:
    """Write a data set of some files; nothing is written unless all of them can be read.

    Args:
        files: exports, each a trial named after its file.
        gaits: what was commanded: one name or gait file for all, or one for each.
        folder: the new data set.
        options: what the files do not say themselves.

    Raises:
        GaitoptError: the folder is not empty, or a file cannot be imported.
    """
    check_new_or_empty(folder)
    if len(gaits) not in (1, len(files)):
        raise GaitoptError(f"--gait: found {len(gaits)} for {len(files)} files; allowed: one, or one each")
    names = [path.stem for path in files]
    if len(set(names)) < len(names):
        raise GaitoptError(f"two files have the same name: {', '.join(sorted(names))}")
    imported = [import_file(path, options) for path in files]
    each = list(gaits) * len(files) if len(gaits) == 1 else gaits
    entries = []
    with filling(folder):
        for name, gait, motion in zip(names, each, imported, strict=True):
            entries.append(_write_trial(folder, name, _gait_beside(folder, gait), motion, options))
        content = {"trial": entries}
        write_text(folder / DATASET_FILE, tomli_w.dumps(content))
        validated(DataSetFile, content, folder / DATASET_FILE)
    return imported


def _gait_beside(folder: Path, gait: str) -> str:
    """Copy a gait file into the data set's folder; return the name to refer to."""
    path = Path(gait)
    if not path.is_file():
        return gait
    if path.name == DATASET_FILE:
        raise GaitoptError(f"--gait: {path}: a data set has a file of this name; rename the gait's")
    (folder / path.name).write_bytes(read_bytes(path))
    return path.name


def _write_trial(
    folder: Path, name: str, gait: str, motion: Imported, options: ImportOptions
) -> dict[str, Any]:
    """Write the table of a trial; return its entry in the data set's file."""
    signals = {signal: measured_column_of(signal) for signal in motion.signals}
    columns = {"t_s": motion.time} | {signals[name]: series for name, series in motion.signals.items()}
    write_text(folder / f"{name}.csv", csv_text(columns).replace("nan", ""))
    entry: dict[str, Any] = {"name": name, "gait": gait, "file": f"{name}.csv", "time": "t_s"}
    if options.sync_at_s is not None:
        entry["starts_at_gait_time_s"] = -options.sync_at_s
    if options.fps is not None:
        entry["fps"] = options.fps
    return entry | {"signals": signals}
