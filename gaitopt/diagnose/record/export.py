"""An export of a tracking program: its cells, and what every importer needs to read them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.core.units import LENGTH, TIME
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.tables import Cells, TextTable, decimal_mark, table
from gaitopt.diagnose.record.trial import Series

VIEWS = {"side": ("marker.x", "marker.z"), "top": ("marker.x", "marker.y")}
"""Signals of the picture's two axes: forward and up seen from the side, forward and left seen from above."""


@dataclass(frozen=True)
class ImportOptions:
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

    def check(self) -> None:
        """Check what can be checked without a file.

        Raises:
            GaitoptError: the view is unknown, or a number is out of range.
        """
        if self.view not in VIEWS:
            raise bad_value("--view", "view", self.view, ", ".join(VIEWS), VIEWS)
        for option, value, low, high in (
            ("--fps", self.fps, 0.01, 1e6),
            ("--scale-m-per-px", self.scale_m_per_px, 1e-9, 1e3),
            ("--sync-at", self.sync_at_s, -1e9, 1e9),
        ):
            if value is not None and not low <= value <= high:
                raise bad_value("gaitopt import", option, value, f"{low:g} to {high:g}")


@dataclass(frozen=True)
class Motion:
    """What an importer reads from an export.

    Attributes:
        time: time stamps, s, shape (n,).
        signals: series by signal, m or rad, each of shape (n,).
        defects: what was changed or left out.
    """

    time: Series
    signals: Mapping[str, Series]
    defects: list[Defect] = field(default_factory=list)


@dataclass(frozen=True)
class Export:
    """One file that a tracking program wrote.

    Attributes:
        path: the file.
        rows: its cells; no row is empty.
        options: what the file does not say itself.
    """

    path: Path
    rows: Cells
    options: ImportOptions

    def table(self, head: Sequence[str], begin: int, decimal: str | None = None) -> TextTable:
        """Return the rows from index `begin` under the names `head`.

        Args:
            head: the columns' names.
            begin: index of the first row of numbers.
            decimal: the decimal mark; taken from the numbers by default.

        Raises:
            GaitoptError: see `tables.table`.
        """
        mark = decimal_mark(self.rows[begin:]) if decimal is None else decimal
        return table(self.path, self.rows, head, begin, mark)

    def chosen(self, names: Sequence[str]) -> str:
        """Return the requested point, or the only one.

        Raises:
            GaitoptError: there is no such point, or there are several and none was requested.
        """
        wanted = self.options.marker
        if wanted is not None and wanted not in names:
            raise unknown_name(f"{self.path}: --marker", "point", wanted, names)
        if wanted is None and len(names) != 1:
            listed = ", ".join(names) or "none"
            raise GaitoptError(f"{self.path}: several points; choose one with --marker: {listed}")
        return wanted or names[0]

    def seconds(self, series: Series, usual: str) -> Series:
        """Return time stamps in s; their unit is the requested one, or the program's usual one."""
        return series * self._unit(self.options.time_unit or usual, TIME, "--time-unit")

    def frames(self, frames: Series) -> Series:
        """Return the time stamps of frame numbers, s.

        Raises:
            GaitoptError: the frame rate is not given.
        """
        if self.options.fps is None:
            raise GaitoptError(f"{self.path}: counts frames; its frame rate is needed: --fps")
        return frames / self.options.fps

    def lengths(self, points: Sequence[Series]) -> dict[str, Series]:
        """Return signals in m from calibrated lengths, whose second axis grows upward."""
        scale = self._unit(self.options.length_unit or "m", LENGTH, "--length-unit")
        return dict(zip(VIEWS[self.options.view], (scale * point for point in points), strict=True))

    def pixels(self, points: Sequence[Series]) -> tuple[dict[str, Series], Defect]:
        """Return signals in m from pixels, whose second axis grows downward, and what was done to them.

        Raises:
            GaitoptError: the size of a pixel is not given.
        """
        scale = self.options.scale_m_per_px
        if scale is None:
            raise GaitoptError(f"{self.path}: is in pixels; their size is needed: --scale-m-per-px")
        across, down = (scale * point for point in points)
        message = f"pixels, y down: turned up and scaled by {scale:g} m/px"
        turned = Defect("pixels", self.path.stem, message, parameters={"scale_m_per_px": scale})
        return dict(zip(VIEWS[self.options.view], (across, -down), strict=True)), turned

    def _unit(self, unit: str, units: Mapping[str, float], option: str) -> float:
        if unit not in units:
            raise bad_value(self.path, option, unit, ", ".join(units), units)
        return units[unit]


@dataclass(frozen=True)
class Importer:
    """How the exports of one program are read.

    Attributes:
        program: the program's name.
        recognises: whether rows of cells are such an export.
        read: reads one.
    """

    program: str
    recognises: Callable[[Cells], bool]
    read: Callable[[Export], Motion]
