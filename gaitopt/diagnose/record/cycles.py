"""Series cut into cycles of the gait: one row a cycle, one column a phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.trial import Series
from gaitopt.gait.drive import Drive
from gaitopt.problem.records import Horizon

PHASES = 240
"""Phases of a cycle at which series are compared: 17 ms apart at 4 s."""


@dataclass(frozen=True)
class CycleSettings:
    """When a phase of a cycle counts as measured.

    Attributes:
        near_cycles: a sample lies within this share of a cycle,
        near_frames: or within this many frames.
    """

    near_cycles: float = 0.03
    near_frames: float = 2.0


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
        count: number of cycles.
        period: length of a cycle, s.
    """

    begin: float
    count: int
    period: float

    @staticmethod
    def of(time: Series, period: float, transient: float, name: str) -> Cycles:
        """Return the whole cycles that end with the recording: after the transient, if two fit there.

        Args:
            time: gait times of the samples that count, s, shape (n,).
            period: of the drive, s.
            transient: gait time from which the motion may be steady, s.
            name: name of the trial, for the message.

        Raises:
            GaitoptError: fewer than two cycles are left.
        """
        frame = float(np.median(np.diff(np.unique(time))))
        end = float(time[-1]) + frame  # the last frame lasts until the next one would come
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

    def sampled(
        self, time: Series, series: Series, frame_s: float, settings: CycleSettings = CycleSettings()
    ) -> Series:
        """Return a series at each cycle and phase, shape (count, PHASES); NaN where no sample is near.

        Args:
            time: gait times of the samples that count, s, shape (n,).
            series: their values, shape (n,).
            frame_s: typical time between samples, s.
            settings: which samples are near.
        """
        times = self.times
        after = np.clip(np.searchsorted(time, times), 1, len(time) - 1)
        distance = np.minimum(np.abs(time[after] - times), np.abs(times - time[after - 1]))
        near = max(settings.near_cycles * self.period, settings.near_frames * frame_s)
        sampled: Series = np.where(distance <= near, np.interp(times, time, series), np.nan)
        return sampled


def cycle_means(rows: Series) -> Series:
    """Return the mean of each cycle, shape (count,); NaN for a cycle without any sample."""
    counts = np.isfinite(rows).sum(axis=1)
    sums = np.nansum(rows, axis=1)
    means: Series = np.divide(sums, counts, out=np.full(len(rows), np.nan), where=counts > 0)
    return means


@dataclass(frozen=True)
class SteadyMotion:
    """Cycles split into travel, shape and rest.

    Attributes:
        travel: travel per cycle.
        shape: the mean cycle without travel, of zero mean, shape (PHASES,).
        rest: what is left of each sample, shape (count, PHASES).
    """

    travel: float
    shape: Series
    rest: Series


def steady(rows: Series) -> SteadyMotion:
    """Split cycles into travel, shape and rest.

    The travel is fitted within phases: there only whole cycles lie between samples, so that the motion
    inside a cycle does not disturb it.

    Args:
        rows: a series by cycle and phase, shape (count, PHASES).
    """
    count = len(rows)
    cycle = np.arange(count)[:, None] + np.arange(PHASES)[None, :] / PHASES
    phase_means = _column_means(rows)
    weight = np.isfinite(rows)
    level = cycle - _column_means(np.where(weight, cycle, np.nan))
    above = np.where(weight, (rows - phase_means) * level, 0.0).sum()
    below = np.where(weight, level**2, 0.0).sum()
    travel = float(above / below) if below > 0.0 else 0.0
    flat = rows - travel * cycle
    shape = _filled(_column_means(flat))
    return SteadyMotion(travel, shape - shape.mean(), flat - shape)


def _column_means(rows: Series) -> Series:
    """Return the mean of each phase, shape (PHASES,); NaN for a phase without any sample."""
    counts = np.isfinite(rows).sum(axis=0)
    sums = np.nansum(rows, axis=0)
    means: Series = np.divide(sums, counts, out=np.full(rows.shape[1], np.nan), where=counts > 0)
    return means


def _filled(shape: Series) -> Series:
    """Return a shape with its unmeasured phases interpolated between their neighbours in the cycle."""
    known = np.flatnonzero(np.isfinite(shape))
    if len(known) in (0, len(shape)):
        return np.nan_to_num(shape)
    filled: Series = np.interp(np.arange(len(shape)), known, shape[known], period=len(shape))
    return filled


def shifted(shape: Series, cycles: float) -> Series:
    """Return a periodic shape delayed by a share of the cycle, shape (PHASES,)."""
    position = np.arange(len(shape)) - cycles * len(shape)
    delayed: Series = np.interp(position, np.arange(len(shape)), shape, period=len(shape))
    return delayed
