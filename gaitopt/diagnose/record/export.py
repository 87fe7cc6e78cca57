"""A file to import: its cells, and what every importer needs to read them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.core.files import read_text
from gaitopt.core.units import ANGLE, LENGTH, TIME
from gaitopt.diagnose.record.columns import COUNTS, PULSE
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.tables import Cells, TextTable, decimal_mark, read_cells, table
from gaitopt.diagnose.record.trial import Series

VIEWS = {"side": ("marker.x", "marker.z"), "top": ("marker.x", "marker.y")}
"""Signals of the picture's two axes: forward and up seen from the side, forward and left seen from above."""

NORMALISED = "normalised"
"""Angles from -100 to 100, as LeRobot writes them: 100 is an angle that differs from joint to joint."""

ANGLE_UNITS = (*ANGLE, NORMALISED, COUNTS, PULSE)
"""Units of angles in logs; pulse widths are commands alone."""


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
        commands: column of each channel in a log, where names do not say it; if given, no others are taken.
        signals: the same for each signal.
        angle_unit: unit of angles in a log whose columns have none in their names, one of `ANGLE_UNITS`.
        counts_per_turn: counts of an encoder in a turn; half of it is angle 0.
        full_scale_deg: angle at 100 of normalised angles, degrees, by channel or joint; under the empty name
            that of all others.
    """

    fps: float | None = None
    scale_m_per_px: float | None = None
    time_unit: str | None = None
    length_unit: str | None = None
    view: str = "side"
    marker: str | None = None
    sync_at_s: float | None = None
    commands: Mapping[str, str] = field(default_factory=dict)
    signals: Mapping[str, str] = field(default_factory=dict)
    angle_unit: str | None = None
    counts_per_turn: float = 4096.0
    full_scale_deg: Mapping[str, float] = field(default_factory=dict)

    def check(self) -> None:
        """Check what can be checked without a file.

        Raises:
            GaitoptError: the view is unknown, or a number is out of range.
        """
        if self.view not in VIEWS:
            raise bad_value("--view", "view", self.view, ", ".join(VIEWS), VIEWS)
        if self.angle_unit not in (None, *ANGLE_UNITS):
            allowed = ", ".join(ANGLE_UNITS)
            raise bad_value("gaitopt import", "--angle-unit", self.angle_unit, allowed, ANGLE_UNITS)
        for option, value, low, high in (
            ("--fps", self.fps, 0.01, 1e6),
            ("--scale-m-per-px", self.scale_m_per_px, 1e-9, 1e3),
            ("--sync-at", self.sync_at_s, -1e9, 4e9),
            ("--counts-per-turn", self.counts_per_turn, 2.0, 1e9),
            *(("--full-scale-deg", scale, 1e-3, 1e6) for scale in self.full_scale_deg.values()),
        ):
            if value is not None and not low <= value <= high:
                raise bad_value("gaitopt import", option, value, f"{low:g} to {high:g}")


@dataclass(frozen=True)
class Sent:
    """The commands of a log, each held until the next row.

    Attributes:
        time: time stamps on the clock of the recording, s, shape (m,), rising.
        columns: ``NAME_rad``, rad, or ``NAME_us``, µs, NAME being the channel, each of shape (m,); NaN: the
            servo is unpowered.
    """

    time: Series
    columns: Mapping[str, Series]


@dataclass(frozen=True)
class Motion:
    """What an importer reads: one recording.

    Attributes:
        time: time stamps, s, shape (n,).
        signals: series by signal, m or rad, each of shape (n,).
        defects: what was changed or left out.
        name: name of the trial; that of the file by default.
        sent: the commands, where it holds some.
        zero_s: stamp of the file's own clock that is zero in `time`, s.
        sync_at_s: stamp at which the gait began, s, where the file shows it; else that of the options.
        fps: frames a second, where the file says it; else those of the options.
    """

    time: Series
    signals: Mapping[str, Series]
    defects: list[Defect] = field(default_factory=list)
    name: str | None = None
    sent: Sent | None = None
    zero_s: float = 0.0
    sync_at_s: float | None = None
    fps: float | None = None


@dataclass(frozen=True)
class Export:
    """One file or folder to import.

    Attributes:
        path: where it is.
        options: what it does not say itself.
    """

    path: Path
    options: ImportOptions

    @cached_property
    def text(self) -> str:
        """The content of a text file."""
        return read_text(self.path)

    @cached_property
    def rows(self) -> Cells:
        """The cells of a text file; no row is empty."""
        return read_cells(self.path)

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
    """How the files of one program are read.

    Attributes:
        program: the program's name.
        recognises: whether a file is one of its.
        read: reads one; returns one or more recordings.
        maps: whether columns are chosen by name.
    """

    program: str
    recognises: Callable[[Export], bool]
    read: Callable[[Export], Motion | Sequence[Motion]]
    maps: bool = False
