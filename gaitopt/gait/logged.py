"""Logged commands: rows of targets, each held until the next one, as a log of a robot gives them."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

BLOCK_S = 0.25
"""Usual length of a block, s: a few times the dead time and lag of a servo."""

SAMPLES_PER_BLOCK = 4
"""A block has at least this many samples of the recordings."""

_EDGE_S = 1e-9
"""A time this close before a row counts as on it: clocks are sums of rounded steps."""

_SAME_TIME_S = 1e-6
"""Two logs have the same commands if their rows differ in time by less than about this."""

_LONE_ROW_S = 1.0
"""How long a log of one row lasts where nothing else says so, s."""


@dataclass(frozen=True, eq=False)
class LoggedCommands:
    """A `Drive` of logged commands. Gait time 0 is its first row.

    Attributes:
        channels: name of each column, in the problem's order.
        time: gait time from which each row holds, s, shape (n,), rising from 0.
        rows: targets, rad, shape (n, nu). NaN: the servo is unpowered.
        name: what reports call it.
        duration_s: how long it lasts, s.
        block_s: length of the blocks in which a trial is judged, s.
        start: angle at which joints rest at gait time 0, rad by name, where it was measured.
        ranges: travel of each servo, rad, shape (nu, 2); None where it is not known.
        first_s: time of the first row on the log's own clock, s.
    """

    channels: tuple[str, ...]
    time: NDArray[np.float64]
    rows: NDArray[np.float64]
    name: str
    duration_s: float
    block_s: float
    start: Mapping[str, float] | None = None
    ranges: NDArray[np.float64] | None = None
    first_s: float = 0.0

    period_s: ClassVar[None] = None

    @staticmethod
    def of(
        channels: Sequence[str],
        time: ArrayLike,
        rows: ArrayLike,
        name: str = "log",
        ranges: NDArray[np.float64] | None = None,
    ) -> LoggedCommands:
        """Return the commands of a log; it ends a usual step after its last row.

        Args:
            channels: name of each column.
            time: time of each row on the log's clock, s, shape (n,), strictly rising.
            rows: targets, rad, shape (n, nu). NaN: the servo is unpowered.
            name: what reports call it.
            ranges: travel of each servo, rad, shape (nu, 2), where it is known.
        """
        stamps = np.array(time, dtype=float)
        since = stamps - stamps[0]
        step = float(np.median(np.diff(since))) if len(since) > 1 else 0.0
        duration = float(since[-1]) + step or _LONE_ROW_S
        held = np.array(rows, dtype=float).reshape(len(since), len(channels))
        first = float(stamps[0])
        return LoggedCommands(
            tuple(channels), since, held, name, duration, _block(duration), None, ranges, first
        )

    def recorded(
        self, until_s: float, frame_s: float, start: Mapping[str, float] | None = None
    ) -> LoggedCommands:
        """Return the same commands for their recordings: they last as long as the longest of them.

        Args:
            until_s: gait time at which the longest recording ends, s.
            frame_s: time between two samples of the recordings, s.
            start: angle at which joints rest at gait time 0, rad by name, where it was measured.
        """
        duration = max(self.duration_s, until_s)
        return replace(self, duration_s=duration, block_s=_block(duration, frame_s), start=start)

    def targets(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the row that holds at gait times t, s, shape (n,): rad, shape (n, nu); NaN: unpowered.

        Before its first row, the first row holds.
        """
        index = np.searchsorted(self.time, np.asarray(t, dtype=float) + _EDGE_S, side="right") - 1
        held: NDArray[np.float64] = self.rows[np.maximum(index, 0)]
        return held

    @property
    def changes(self) -> NDArray[np.float64]:
        """Gait times of the rows that command something else than the row before, s; the first row is one."""
        return self.time[self._changed]

    @cached_property
    def _changed(self) -> NDArray[np.bool_]:
        same = (self.rows[1:] == self.rows[:-1]) | (np.isnan(self.rows[1:]) & np.isnan(self.rows[:-1]))
        return np.concatenate([[True], ~same.all(axis=1)])

    @cached_property
    def commands_key(self) -> str:
        """Equal for two logs that command the same: rows that repeat the one before do not count."""
        changed = self._changed
        stamps = np.rint(self.time[changed] / _SAME_TIME_S).astype(np.int64)
        rows = np.where(np.isnan(self.rows), np.nan, self.rows + 0.0)[changed]  # one NaN and one zero
        return hashlib.sha256(stamps.tobytes() + rows.tobytes()).hexdigest()

    @cached_property
    def key(self) -> str:
        """Equal for two logs that command the same from the same start."""
        start = sorted((self.start or {}).items())
        return hashlib.sha256(f"{self.commands_key}{start!r}".encode()).hexdigest()

    @property
    def beyond_range(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest target of each channel that is commanded beyond its servo's travel, rad."""
        if self.ranges is None:
            return {}
        found = {}
        for channel, column, (low, high) in zip(self.channels, self.rows.T, self.ranges, strict=True):
            powered = column[np.isfinite(column)]
            if len(powered) and (powered.min() < low - 1e-6 or powered.max() > high + 1e-6):
                found[channel] = (float(powered.min()), float(powered.max()))
        return found


def _block(duration: float, frame_s: float = 0.0) -> float:
    """Return the length of equal blocks, s: about `BLOCK_S`, and not below `SAMPLES_PER_BLOCK` samples."""
    usual = max(1, round(duration / BLOCK_S))
    if frame_s:
        most = math.floor(duration / (SAMPLES_PER_BLOCK * frame_s) * (1.0 + 1e-9))
        usual = max(1, min(usual, most))
    return duration / usual
