"""The gap of one signal of one trial, split into drift, stride, timing, transient and noise.

In its steady motion a measured signal m is compared with the simulated signal s as

    m(t) = origin + size * s(t - delay) + drift * t / T + rest,

with T the period. The components are

- timing: the delay;
- stride: the size, and the travel that goes with it. A robot that moves 10 % less inside each cycle also
travels 10 % less. What is left of the mean cycle belongs to it too: its shape, or the level of an angle;
- drift: the travel per cycle that neither explains, for example from slip, a slope or drag;
- noise: what differs from cycle to cycle;
- transient: what differs before the steady motion.

Commands without a period have no cycles, and other components; see `split_commands`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.settings import DEFAULT, SplitSettings
from gaitopt.diagnose.record.cycles import PHASES, Cycles, cycle_means, shifted, steady
from gaitopt.diagnose.record.trial import Series

COMPONENTS = ("drift", "stride", "timing", "transient", "noise")

PHASE_BINS = 24
"""Columns of the map of the gap over the cycle."""


@dataclass(frozen=True)
class Split:
    """One signal of one trial, measured against simulated.

    Attributes:
        signal: name of the signal.
        squares: mean square of each component of the gap by name, m² or rad².
        travel: measured and simulated travel per cycle, m or rad; None where the drive has no period.
        size: size of the motion about its travel, measured over simulated.
        delay_s: how much later than simulated the motion comes, s.
        by_phase: RMS of the gap inside the cycle, drift removed, at each share of the gait's cycle,
            m or rad, shape (PHASE_BINS,). NaN where nothing was measured; empty where the drive has no
            period.
    """

    signal: str
    squares: Mapping[str, float]
    travel: tuple[float, float] | None
    size: float
    delay_s: float
    by_phase: Series

    @property
    def rms(self) -> float:
        """The gap, m or rad."""
        return math.sqrt(sum(self.squares.values()))

    @property
    def shares(self) -> dict[str, float]:
        """Share of each component of the squared gap, by name."""
        total = sum(self.squares.values()) or 1.0
        return {name: square / total for name, square in self.squares.items()}


def split(
    aligned: Aligned,
    signal: str,
    transient: float,
    extra: Mapping[str, float],
    settings: SplitSettings = DEFAULT.split,
) -> Split:
    """Split the gap of one signal of a gait into its components; their squares add up to its mean square.

    Args:
        aligned: the trial aligned with its prediction.
        signal: the signal.
        transient: gait time from which the motion may be steady, s.
        extra: mean square that defects put into the record, by the component they belong to; it is added.
        settings: see `SplitSettings`.

    Raises:
        GaitoptError: fewer than two cycles can be used.
    """
    trial, period = aligned.trial, aligned.trial.drive.period_s
    assert period is not None, "a drive without a period has no cycles"
    keep = trial.used[signal]
    time, residual = aligned.time[keep], aligned.residual[signal][keep]
    cycles = Cycles.of(time, period, transient, trial.name)
    measured = cycles.sampled(time, trial.signals[signal][keep], trial.frame_s)
    simulated = np.interp(cycles.times, aligned.simulated.time, aligned.simulated[signal])
    simulated = np.where(np.isfinite(measured), simulated, np.nan)
    gap = measured - simulated
    seen, predicted, apart = steady(measured), steady(simulated), steady(gap)
    delay, size = _delay_and_size(
        seen.shape, predicted.shape, lambda turns: shifted(predicted.shape, turns), settings
    )
    squares = _travel(seen.travel - predicted.travel, (size - 1.0) * predicted.travel, time, period)
    delayed = shifted(predicted.shape, delay)
    noise = float(np.nanmean(apart.rest**2)) * cycles.count / (cycles.count - 1)
    squares["timing"] = float(np.mean((delayed - predicted.shape) ** 2))
    squares["stride"] += max(0.0, float(np.mean((seen.shape - delayed) ** 2)) - noise / cycles.count)
    # The mean residual of a marker is 0, because its origin is free; that of an angle is its level.
    squares["stride"] += float(np.mean(residual)) ** 2
    squares["noise"] = noise
    squares["transient"] = _transient(time, residual, cycles, gap, noise)
    total = _scaled(squares, residual, extra)
    by_phase = _by_phase(cycles, gap, float(np.mean(residual)))
    return Split(signal, total, (seen.travel, predicted.travel), size, delay * period, by_phase)


def _scaled(squares: Mapping[str, float], residual: Series, extra: Mapping[str, float]) -> dict[str, float]:
    """Return components that add up to the gap, with the error that defects add to each.

    The components overlap a little, so each is scaled by the same factor.
    """
    scale = float(np.mean(residual**2)) / (sum(squares.values()) or 1.0)
    return {name: scale * squares[name] + extra.get(name, 0.0) for name in COMPONENTS}


def _delay_and_size(
    shape: Series, simulated: Series, delayed_by: Callable[[float], Series], settings: SplitSettings
) -> tuple[float, float]:
    """Return the delay, in blocks, and the size that bring the simulated shape onto the measured one.

    Both are neutral where the measured motion does not resemble the simulated one.

    Args:
        shape: the measured motion.
        simulated: the simulated motion.
        delayed_by: returns the simulated motion later by a delay, in blocks.
        settings: see `SplitSettings`.
    """
    best, delay, size = float(np.mean((shape - simulated) ** 2)), 0.0, 1.0
    for candidate in np.linspace(-settings.largest_delay, settings.largest_delay, settings.delays).tolist():
        delayed = delayed_by(candidate)
        power = float(delayed @ delayed)
        scale = float(delayed @ shape) / power if power > 0.0 else 1.0
        error = float(np.mean((shape - scale * delayed) ** 2))
        if error < best:
            best, delay, size = error, candidate, scale
    resembles = best < settings.resembles * float(np.mean(shape**2))
    return (delay, size) if resembles else (0.0, 1.0)


def _travel(difference: float, by_size: float, time: Series, period: float) -> dict[str, float]:
    """Return the squares of a difference in travel: the part that the size of the stride explains, and drift.

    The explained part lies between nothing and the whole difference.

    Args:
        difference: measured minus simulated travel per period, m or rad.
        by_size: difference in travel that the size of the motion makes, m or rad.
        time: gait times of the samples, s, shape (n,).
        period: s.
    """
    explained = float(np.clip(by_size / difference, 0.0, 1.0)) if difference else 0.0
    elapsed = np.maximum(time, 0.0) / period
    square = difference**2 * float(elapsed.var())
    return {"stride": explained * square, "drift": (1.0 - explained) * square}


def _transient(time: Series, residual: Series, cycles: Cycles, rows: Series, noise: float) -> float:
    """Return the mean square by which samples before the whole cycles differ from these; over all samples."""
    early = time < cycles.begin
    if not early.any():
        return 0.0
    motion = steady(rows)
    turns = (time - cycles.begin) / cycles.period
    pattern = np.interp(np.mod(turns, 1.0), np.arange(PHASES) / PHASES, motion.shape, period=1.0)
    pattern = pattern + motion.travel * turns
    stray = residual - pattern
    stray = stray - stray[~early].mean()
    return max(0.0, float((stray[early] ** 2).sum()) - noise * int(early.sum())) / len(time)


def _by_phase(cycles: Cycles, rows: Series, mean: float) -> Series:
    """Return the RMS at each share of the gait's cycle, travel removed, with the residual's `mean`."""
    flat = rows - steady(rows).travel * (
        np.arange(cycles.count)[:, None] + np.arange(PHASES)[None, :] / PHASES
    )
    flat = flat - np.nanmean(cycle_means(flat)) + mean
    bins = np.broadcast_to((cycles.phases * PHASE_BINS).astype(int), flat.shape)
    finite = np.isfinite(flat)
    counts = np.bincount(bins[finite], minlength=PHASE_BINS)
    squares = np.bincount(bins[finite], flat[finite] ** 2, minlength=PHASE_BINS)
    means = np.divide(squares, counts, out=np.full(PHASE_BINS, np.nan), where=counts > 0)
    by_phase: Series = np.sqrt(means)
    return by_phase
