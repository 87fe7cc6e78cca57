"""Exports of tracking programs to data sets: recognised by their heads, converted, never guessed at."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import ArrayLike, NDArray

from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.core.files import csv_text, write_text
from gaitopt.core.folders import check_new_or_empty, filling
from gaitopt.core.units import ANGLE, LENGTH, TIME, suffix_scale
from gaitopt.core.validation import validated
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import DATASET_FILE, DataSetFile
from gaitopt.diagnose.record.defect import Defect, counted, spans_of
from gaitopt.diagnose.record.tables import read_rows, table
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.signals import measured_column_of

Series = NDArray[np.float64]

VIEWS = {"side": ("marker.x", "marker.z"), "top": ("marker.x", "marker.y")}
"""What the picture's two axes are: seen from the side, forward and up; from above, forward and left."""

LIKELY = 0.6
"""Points less likely than this are blanked: DeepLabCut gives coordinates even where it sees nothing."""

_HEAD_LINES = 500
"""Lines that tell how a file's cells are parted."""


@dataclass(frozen=True)
class UnknownDrive:
    """Commands that an export does not name; only a block length to judge defects by is assumed."""

    name: str = ""
    key: str = "unknown"
    period_s: None = None
    block_s: float = 1.0
    duration_s: None = None

    def targets(self, t: ArrayLike) -> Series:
        """Raise an error: the targets are not known."""
        raise GaitoptError("the commands of an export are not known before it is part of a data set")


@dataclass(frozen=True)
class Options:
    """What a file does not say itself.

    Attributes:
        fps: frames a second, where a file counts frames.
        scale_m_per_px: metres a pixel, where a file is in pixels.
        time_unit, length_unit: units of columns whose names carry none; the program's usual ones by
            default.
        view: which signals the picture's axes are, a key of `VIEWS`.
        marker: which of several tracked points.
        sync_at_s: time stamp at which the gait began, s, if a mark was filmed.
    """

    fps: float | None = None
    scale_m_per_px: float | None = None
    time_unit: str | None = None
    length_unit: str | None = None
    view: str = "side"
    marker: str | None = None
    sync_at_s: float | None = None


@dataclass(frozen=True)
class Imported:
    """One file in SI units: the program it came from, time stamps, signals, and what is wrong with it."""

    program: str
    time: Series
    signals: Mapping[str, Series]
    defects: tuple[Defect, ...]


# --- one file ---------------------------------------------------------------------------------


def import_file(path: Path, options: Options) -> Imported:
    """Return the motion in an export of Tracker, DeepLabCut, SLEAP, Kinovea, or in a plain CSV file.

    Raises:
        GaitoptError: the file is none of these, or an option that it needs is missing.
    """
    if options.view not in VIEWS:
        raise bad_value("--view", "view", options.view, ", ".join(VIEWS), VIEWS)
    for option, value, low, high in (
        ("--fps", options.fps, 0.01, 1e6),
        ("--scale-m-per-px", options.scale_m_per_px, 1e-9, 1e3),
        ("--sync-at", options.sync_at_s, -1e9, 1e9),
    ):
        if value is not None and not low <= value <= high:
            raise bad_value("gaitopt import", option, value, f"{low:g} to {high:g}")
    rows = _cells(path)
    reader = next((read for is_like, read in _FORMATS if is_like(rows)), None)
    if reader is None:
        raise GaitoptError(
            f"{path}: not an export of Tracker, DeepLabCut, SLEAP or Kinovea, nor a CSV table with a time "
            "column such as t_s"
        )
    program, time, signals, defects = reader(path, rows, options)
    order = np.argsort(time, kind="stable") if program == "SLEAP" else np.arange(len(time))
    trial = Trial.of(path.stem, UnknownDrive(), time[order], {n: s[order] for n, s in signals.items()})
    if np.isnan(trial.time).any():
        raise GaitoptError(f"{path}: {int(np.isnan(trial.time).sum())} time stamps are missing")
    backward = np.flatnonzero(np.diff(trial.time) < 0.0)
    if len(backward):
        raise GaitoptError(f"{path}: time goes backward after {trial.time[backward[0]]:g} s")
    if not any(used.any() for used in trial.used.values()) or len(np.unique(trial.time)) < 3:
        raise GaitoptError(f"{path}: fewer than three samples")
    found = clean(trial).defects
    return Imported(program, trial.time, trial.signals, (*defects, *found))


def _cells(path: Path) -> list[list[str]]:
    """Return a file's cells, cut at the delimiter that gives most of its first rows the same width."""
    heads = {mark: _filled(read_rows(path, mark, _HEAD_LINES)) for mark in ("\t", ";", ",", " ")}
    rows = _filled(read_rows(path, max(heads, key=lambda mark: _agreement(heads[mark]))))
    if not rows:
        raise GaitoptError(f"{path}: empty")
    return rows


def _filled(rows: Sequence[list[str]]) -> list[list[str]]:
    return [row for row in rows if any(row)]


def _agreement(rows: Sequence[Sequence[str]]) -> tuple[bool, float]:
    """Return whether rows have several cells, and how many of them are as wide as the most usual."""
    widths = [len(row) for row in rows]
    if not widths:
        return False, 0.0
    usual = max(set(widths), key=widths.count)
    return usual > 1, widths.count(usual) / len(widths)


def _decimal(rows: Sequence[Sequence[str]]) -> str:
    """Return the decimal mark: a comma where cells hold numbers with one and none with a point."""
    cells = [cell for row in rows for cell in row if any(letter.isdigit() for letter in cell)]
    return "," if any("," in cell for cell in cells) and not any("." in cell for cell in cells) else "."


# --- the programs -----------------------------------------------------------------------------

_Read = tuple[str, Series, dict[str, Series], list[Defect]]


def _is_deeplabcut(rows: Sequence[Sequence[str]]) -> bool:
    return [row[0].lower() for row in rows[:3]] == ["scorer", "bodyparts", "coords"]


def _deeplabcut(path: Path, rows: Sequence[Sequence[str]], options: Options) -> _Read:
    parts = list(dict.fromkeys(rows[1][1:]))
    part = _chosen(path, parts, options.marker)
    if len(rows[1]) != len(rows[2]):
        raise GaitoptError(f"{path}: {len(rows[1])} cells of bodyparts over {len(rows[2])} of coords")
    head = ["frame", *(f"{name}.{coord}" for name, coord in zip(rows[1][1:], rows[2][1:], strict=True))]
    cells = table(path, rows, head, begin=3)
    likely = cells.column(f"{part}.likelihood") >= LIKELY
    points = [np.where(likely, cells.column(f"{part}.{axis}"), np.nan) for axis in "xy"]
    time = _frames(path, cells.column("frame"), options)
    defects = []
    if not likely.all():
        count = int((~likely).sum())
        message = f"{counted(count, 'point')} less likely than {LIKELY:g}: blanked"
        defects.append(Defect("unlikely_points", path.stem, message, count, spans_of(time, ~likely)))
    signals, turned = _from_pixels(path, points, options)
    return "DeepLabCut", time, signals, [*defects, turned]


def _is_sleap(rows: Sequence[Sequence[str]]) -> bool:
    return "frame_idx" in rows[0] and "instance.score" in rows[0]


def _sleap(path: Path, rows: Sequence[Sequence[str]], options: Options) -> _Read:
    cells = table(path, rows, rows[0], begin=1)
    nodes = [name.removesuffix(".x") for name in cells.head if name.endswith(".x")]
    node = _chosen(path, nodes, options.marker)
    frames = cells.column("frame_idx")
    if len(np.unique(frames)) < len(frames):
        raise GaitoptError(f"{path}: several tracks in one file; allowed: one, exported by itself")
    signals, turned = _from_pixels(path, [cells.column(f"{node}.{axis}") for axis in "xy"], options)
    return "SLEAP", _frames(path, frames, options), signals, [turned]


def _is_kinovea(rows: Sequence[Sequence[str]]) -> bool:
    return rows[0][0].lower() == "time" and all("/" in name for name in rows[0][1:] if name)


def _kinovea(path: Path, rows: Sequence[Sequence[str]], options: Options) -> _Read:
    cells = table(path, rows, rows[0], begin=1, decimal=_decimal(rows[1:]))
    objects = list(dict.fromkeys(name.rpartition("/")[0] for name in cells.head[1:] if name))
    chosen = _chosen(path, objects, options.marker)
    time = cells.column(cells.head[0]) * _unit(path, options.time_unit or "ms", TIME, "--time-unit")
    points = [cells.column(f"{chosen}/{axis}") for axis in "XY"]
    return "Kinovea", time, _lengths(path, points, options), []


def _is_tracker(rows: Sequence[Sequence[str]]) -> bool:
    names = [name.lower() for name in rows[1]] if len(rows) > 1 else []
    return names[:1] == ["t"] and "x" in names and "y" in names


def _tracker(path: Path, rows: Sequence[Sequence[str]], options: Options) -> _Read:
    masses = [name for name in rows[0] if name]
    mass = _chosen(path, masses, options.marker)
    begin = 0 if len(masses) == 1 else rows[0].index(mass)
    names, owned = [], False
    for index, name in enumerate(rows[1]):
        owned = owned or index >= begin
        repeated = not owned or name in names
        names.append(name if name == "t" and index == 0 else f"{index}" if repeated else name)
    cells = table(path, rows, names, begin=2, decimal=_decimal(rows[2:]))
    time = cells.column("t") * _unit(path, options.time_unit or "s", TIME, "--time-unit")
    return "Tracker", time, _lengths(path, [cells.column(axis) for axis in "xy"], options), []


def _is_plain(rows: Sequence[Sequence[str]]) -> bool:
    return any(name.rpartition("_")[0] in ("t", "time") for name in rows[0])


def _plain(path: Path, rows: Sequence[Sequence[str]], options: Options) -> _Read:
    cells = table(path, rows, rows[0], begin=1, decimal=_decimal(rows[1:]))
    name = next(name for name in cells.head if name.rpartition("_")[0] in ("t", "time"))
    time = cells.column(name) * suffix_scale(path, "column", name, TIME)
    signals = {}
    for column in cells.head:
        stem = column.rpartition("_")[0]
        axis = stem.removeprefix("marker.")
        if axis in ("x", "y", "z"):
            signals[f"marker.{axis}"] = cells.column(column) * suffix_scale(path, "column", column, LENGTH)
        elif column.rpartition("_")[2] in ANGLE:
            joint = f"joint.{stem.removeprefix('joint.')}"
            signals[joint] = cells.column(column) * suffix_scale(path, "column", column, ANGLE)
    if not signals:
        raise GaitoptError(f"{path}: no column such as x_m or mid_left_rad; it has {', '.join(cells.head)}")
    return "plain CSV", time, signals, []


_FORMATS: Sequence[tuple[Callable[[Sequence[Sequence[str]]], bool], Callable[..., _Read]]] = (
    (_is_deeplabcut, _deeplabcut),
    (_is_sleap, _sleap),
    (_is_kinovea, _kinovea),
    (_is_tracker, _tracker),
    (_is_plain, _plain),
)


# --- what they share --------------------------------------------------------------------------


def _chosen(path: Path, names: Sequence[str], wanted: str | None) -> str:
    if wanted is not None and wanted not in names:
        raise unknown_name(f"{path}: --marker", "point", wanted, names)
    if wanted is None and len(names) != 1:
        raise GaitoptError(f"{path}: several points; choose one with --marker: {', '.join(names) or 'none'}")
    return wanted or names[0]


def _unit(path: Path, unit: str, units: Mapping[str, float], option: str) -> float:
    if unit not in units:
        raise bad_value(path, option, unit, ", ".join(units), units)
    return units[unit]


def _frames(path: Path, frames: Series, options: Options) -> Series:
    if options.fps is None:
        raise GaitoptError(f"{path}: counts frames; its frame rate is needed: --fps")
    return frames / options.fps


def _from_pixels(path: Path, points: Sequence[Series], options: Options) -> tuple[dict[str, Series], Defect]:
    """Return signals in m from pixels, whose second axis grows downward."""
    if options.scale_m_per_px is None:
        raise GaitoptError(f"{path}: is in pixels; their size is needed: --scale-m-per-px")
    across, down = (options.scale_m_per_px * point for point in points)
    message = f"pixels, y down: turned up and scaled by {options.scale_m_per_px:g} m/px"
    turned = Defect("pixels", path.stem, message, parameters={"scale_m_per_px": options.scale_m_per_px})
    return dict(zip(VIEWS[options.view], (across, -down), strict=True)), turned


def _lengths(path: Path, points: Sequence[Series], options: Options) -> dict[str, Series]:
    """Return signals in m from calibrated lengths, whose second axis grows upward."""
    scale = _unit(path, options.length_unit or "m", LENGTH, "--length-unit")
    return dict(zip(VIEWS[options.view], (scale * point for point in points), strict=True))


# --- the data set -----------------------------------------------------------------------------


def import_files(
    files: Sequence[Path], gaits: Sequence[str], folder: Path, options: Options
) -> list[Imported]:
    """Write a data set of some files; nothing is written unless all of them can be read.

    Args:
        files: exports, each a trial named after its file.
        gaits: what was commanded: one name or gait file for all, or one for each.
        folder: the new data set.
        options: what the files do not say themselves.

    Raises:
        GaitoptError: the folder holds something, or a file cannot be imported.
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
    """Copy a gait file beside the data set's; return the name to refer to."""
    path = Path(gait)
    if not path.is_file():
        return gait
    if path.name == DATASET_FILE:
        raise GaitoptError(f"--gait: {path}: a data set has a file of this name; rename the gait's")
    shutil.copyfile(path, folder / path.name)
    return path.name


def _write_trial(folder: Path, name: str, gait: str, motion: Imported, options: Options) -> dict[str, Any]:
    columns = {"t_s": motion.time}
    signals = {}
    for signal, series in motion.signals.items():
        signals[signal] = measured_column_of(signal)
        columns[signals[signal]] = series
    text = csv_text(columns).replace("nan", "")
    write_text(folder / f"{name}.csv", text)
    entry: dict[str, Any] = {"name": name, "gait": gait, "file": f"{name}.csv", "time": "t_s"}
    if options.sync_at_s is not None:
        entry["starts_at_gait_time_s"] = -options.sync_at_s
    if options.fps is not None:
        entry["fps"] = options.fps
    return entry | {"signals": signals}
