"""Importers: one function for each program or format, and the list of them."""

from __future__ import annotations

import re

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.defect import Defect, counted, spans_of
from gaitopt.diagnose.record.export import Export, Importer, Motion
from gaitopt.diagnose.record.json_lines import read_json_lines
from gaitopt.diagnose.record.lerobot import is_lerobot, read_lerobot
from gaitopt.diagnose.record.log import Log
from gaitopt.diagnose.record.log_time import LARGEST_STAMP, is_time

LIKELY = 0.6
"""Points less likely than this are blanked: DeepLabCut gives coordinates even where it sees nothing."""


def _is_lerobot(export: Export) -> bool:
    return is_lerobot(export.path)


def lerobot(export: Export) -> list[Motion]:
    """Read a LeRobot data set: each of its episodes is a recording with commands."""
    return [log.motion(export.options) for log in read_lerobot(export.path)]


def _is_json_lines(export: Export) -> bool:
    return re.match(r"\s*[{\[]", export.text) is not None


def json_lines(export: Export) -> Motion:
    """Read JSON lines: one object a line, with a time stamp, commands and measured angles."""
    return read_json_lines(export.path, export.text).motion(export.options)


def _is_deeplabcut(export: Export) -> bool:
    return [row[0].lower() for row in export.rows[:3]] == ["scorer", "bodyparts", "coords"]


def deeplabcut(export: Export) -> Motion:
    """Read an export of DeepLabCut: three rows of names, then frame numbers and pixels."""
    rows, path = export.rows, export.path
    part = export.chosen(list(dict.fromkeys(rows[1][1:])))
    if len(rows[1]) != len(rows[2]):
        raise GaitoptError(f"{path}: {len(rows[1])} cells of bodyparts over {len(rows[2])} of coords")
    head = ["frame", *(f"{name}.{coord}" for name, coord in zip(rows[1][1:], rows[2][1:], strict=True))]
    cells = export.table(head, begin=3, decimal=".")
    likely = cells.column(f"{part}.likelihood") >= LIKELY
    points = [np.where(likely, cells.column(f"{part}.{axis}"), np.nan) for axis in "xy"]
    time = export.frames(cells.column("frame"))
    defects = []
    if not likely.all():
        count = int((~likely).sum())
        message = f"{counted(count, 'point')} less likely than {LIKELY:g}: blanked"
        defects.append(Defect("unlikely_points", path.stem, message, count, spans_of(time, ~likely)))
    signals, turned = export.pixels(points)
    return Motion(time, signals, [*defects, turned])


def _is_sleap(export: Export) -> bool:
    return "frame_idx" in export.rows[0] and "instance.score" in export.rows[0]


def sleap(export: Export) -> Motion:
    """Read an analysis file of SLEAP: frame numbers and pixels, in any order of the frames."""
    cells = export.table(export.rows[0], begin=1, decimal=".")
    node = export.chosen([name.removesuffix(".x") for name in cells.head if name.endswith(".x")])
    frames = cells.column("frame_idx")
    if len(np.unique(frames)) < len(frames):
        raise GaitoptError(f"{export.path}: several tracks in one file; allowed: one, exported by itself")
    signals, turned = export.pixels([cells.column(f"{node}.{axis}") for axis in "xy"])
    time = export.frames(frames)
    order = np.argsort(time, kind="stable")
    return Motion(time[order], {name: series[order] for name, series in signals.items()}, [turned])


def _is_kinovea(export: Export) -> bool:
    rows = export.rows
    return rows[0][0].lower() == "time" and all("/" in name for name in rows[0][1:] if name)


def kinovea(export: Export) -> Motion:
    """Read an export of Kinovea: milliseconds, then two columns for each object."""
    cells = export.table(export.rows[0], begin=1)
    chosen = export.chosen(list(dict.fromkeys(name.rpartition("/")[0] for name in cells.head[1:] if name)))
    time = export.seconds(cells.column(cells.head[0]), "ms")
    return Motion(time, export.lengths([cells.column(f"{chosen}/{axis}") for axis in "XY"]))


def _is_tracker(export: Export) -> bool:
    rows = export.rows
    names = [name.lower() for name in rows[1]] if len(rows) > 1 else []
    return names[:1] == ["t"] and "x" in names and "y" in names


def tracker(export: Export) -> Motion:
    """Read an export of Tracker: a row of masses, a row of columns of each mass, then numbers."""
    rows = export.rows
    masses = [name for name in rows[0] if name]
    mass = export.chosen(masses)
    begin = 0 if len(masses) == 1 else rows[0].index(mass)
    names: list[str] = []
    owned = False  # whether columns of the chosen mass have begun; other columns are called by their number
    for index, name in enumerate(rows[1]):
        owned = owned or index >= begin
        repeated = not owned or name in names
        names.append(name if name == "t" and index == 0 else f"{index}" if repeated else name)
    cells = export.table(names, begin=2)
    time = export.seconds(cells.column("t"), "s")
    return Motion(time, export.lengths([cells.column(axis) for axis in "xy"]))


def _is_plain(export: Export) -> bool:
    return any(map(is_time, export.rows[0]))


def plain(export: Export) -> Motion:
    """Read a plain CSV table, whose columns say what they hold, such as ``x_mm`` or ``target.mid_rad``."""
    cells = export.table(export.rows[0], begin=1)
    name = next(filter(is_time, cells.head))
    lines = cells.first_line + np.arange(len(cells.rows))
    head = [column for column in cells.head if not is_time(column)]
    stamps = cells.column(name, LARGEST_STAMP)
    return Log(export.path, export.path.stem, name, stamps, lines, head, cells.column).motion(export.options)


IMPORTERS = (
    Importer("LeRobot", _is_lerobot, lerobot, maps=True),
    Importer("JSON lines", _is_json_lines, json_lines, maps=True),
    Importer("DeepLabCut", _is_deeplabcut, deeplabcut),
    Importer("SLEAP", _is_sleap, sleap),
    Importer("Kinovea", _is_kinovea, kinovea),
    Importer("Tracker", _is_tracker, tracker),
    Importer("plain CSV", _is_plain, plain, maps=True),
)
"""All importers; the first that recognises a file reads it."""
