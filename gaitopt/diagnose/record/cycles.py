"""Series cut into cycles of the gait: one row a cycle, one column a phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.drive import Drive
from gaitopt.problem.records import Horizon

Series = NDArray[np.float64]

PHASES = 240
"""Phases of a cycle at which series are compared: 17 ms apart at 4 s."""

_NEAR_CYCLES = 0.03
_NEAR_FRAMES = 2.0
"""A phase counts as measured if a sample lies this near, in cycles or in frames."""


def steady_from(horizon: Horizon, drive: Drive) -> float:
    """Return the gait time from which the motion may be steady, s.

    It is the horizon's transient in whole cycles where the drive has a period, and in seconds otherwise.
    """
    if drive.period_s is None:
        return horizon.transient_s
    return horizon.cycles(drive.period_s)[0] * drive.period_s


@dataclass(frozen=True)
class Cycles:
    """The whole cycles of a trial.

    Attributes:
        begin: gait time at which the first of them begins, s.
        count: how many there are.
        period: s.
    """

    begin: float
    count: int
    period: float

    @staticmethod
    def of(time: Series, period: float, transient: float, name: str) -> Cycles:
        """Return the whole cycles that end with the recording, after the transient if two fit there.

        Args:
            time: gait times of the samples that count, s.
            period: s.
            transient: gait time at which the robot may be in its steady motion, s.
            name: name of the trial, for the message.

        Raises:
            GaitoptError: fewer than two cycles are left.
        """
        frame = float(np.median(np.diff(np.unique(time))))
        end = float(time[-1]) + frame  # the last frame stands for its own interval
        counts = [int((end - begin) / period + 1e-9) for begin in (max(time[0], transient), time[0])]
        count = counts[0] if counts[0] >= 2 else counts[1]
        if count < 2:
            raise GaitoptError(f"trial {name}: fewer than two cycles are left once defects are masked")
        return Cycles(end - count * period, count, period)

    @property
    def times(self) -> Series:
        """Gait time of each cycle and phase, s, shape (count, PHASES)."""
        cycles = np.arange(self.count)[:, None] + np.arange(PHASES)[None, :] / PHASES
        times: Series = self.begin + self.period * cycles
        return times

    @property
    def phases(self) -> Series:
        """Share of the gait's cycle at each column, 0 to 1, shape (PHASES,)."""
        phases: Series = np.mod(self.begin / self.period + np.arange(PHASES) / PHASES, 1.0)
        return phases

    def sampled(self, time: Series, series: Series, frame_s: float) -> Series:
        """Return a series at each cycle and phase, NaN where nothing was measured nearby.

        Args:
            time: gait times of the samples that count, s, shape (n,).
            series: their values, shape (n,).
            frame_s: typical time between samples, s.
        """
        times = self.times
        after = np.clip(np.searchsorted(time, times), 1, len(time) - 1)
        distance = np.minimum(np.abs(time[after] - times), np.abs(times - time[after - 1]))
        near = max(_NEAR_CYCLES * self.period, _NEAR_FRAMES * frame_s)
        sampled: Series = np.where(distance <= near, np.interp(times, time, series), np.nan)
        return sampled


def cycle_means(rows: Series) -> Series:
    """Return the mean of each cycle, shape (count,); NaN for a cycle without any sample."""
    counts = np.isfinite(rows).sum(axis=1)
    sums = np.nansum(rows, axis=1)
    means: Series = np.divide(sums, counts, out=np.full(len(rows), np.nan), where=counts > 0)
    return means


def steady(rows: Series) -> tuple[float, Series, Series]:
    """Split cycles into travel, shape and rest.

    Args:
        rows: a series by cycle and phase, shape (count, PHASES).

    Returns:
        Travel per cycle; the motion inside the mean cycle about its line, of zero mean, shape
        (PHASES,); and what is left of each sample, shape (count, PHASES).
    """
    count = len(rows)
    cycle = np.arange(count)[:, None] + np.arange(PHASES)[None, :] / PHASES
    phase_means = _column_means(rows)
    # Within a phase only whole cycles separate samples, so travel is free of the motion inside a cycle.
    weight = np.isfinite(rows)
    level = cycle - _column_means(np.where(weight, cycle, np.nan))
    above = np.where(weight, (rows - phase_means) * level, 0.0).sum()
    below = np.where(weight, level**2, 0.0).sum()
    travel = float(above / below) if below > 0.0 else 0.0
    flat = rows - travel * cycle
    shape = _filled(_column_means(flat))
    return travel, shape - shape.mean(), flat - shape


def _column_means(rows: Series) -> Series:
    counts = np.isfinite(rows).sum(axis=0)
    sums = np.nansum(rows, axis=0)
    means: Series = np.divide(sums, counts, out=np.full(rows.shape[1], np.nan), where=counts > 0)
    return means


def _filled(shape: Series) -> Series:
    """Return a shape whose unmeasured phases are interpolated around the cycle."""
    known = np.flatnonzero(np.isfinite(shape))
    if len(known) in (0, len(shape)):
        return np.nan_to_num(shape)
    filled: Series = np.interp(np.arange(len(shape)), known, shape[known], period=len(shape))
    return filled


def shifted(shape: Series, cycles: float) -> Series:
    """Return a periodic shape delayed by a share of the cycle."""
    position = np.arange(len(shape)) - cycles * len(shape)
    delayed: Series = np.interp(position, np.arange(len(shape)), shape, period=len(shape))
    return delayed
