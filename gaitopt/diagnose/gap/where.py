"""Where the gap lies: drift per cycle, stride, timing, transient and noise, per signal and trial.

In its steady motion a measured signal m is compared with the simulated s as

    m(t) = origin + size * s(t - delay) + drift * t / T + what is left,

with T the period. `delay` is timing. `size` is stride, with the travel that goes with it: a robot that
moves 10 % less inside each cycle also gets 10 % less far. `drift` is the travel per cycle that neither
explains: slip, slope, drag. What is left of the mean cycle is stride again: its shape, or the level of
an angle; what differs from cycle to cycle is noise; what differs before the steady motion is transient.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.gap.align import Aligned, without_line
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.record.cycles import PHASES, Cycles, cycle_means, shifted, steady
from gaitopt.diagnose.record.noise import noise_of
from gaitopt.robot.signals import unit_of

Series = NDArray[np.float64]

COMPONENTS = ("drift", "stride", "timing", "transient", "noise")

PHASE_BINS = 24
"""Columns of the gap's map over the cycle."""

_DELAYS = 121
_LARGEST_DELAY = 0.25
"""Delays tried, in cycles either side."""


@dataclass(frozen=True)
class Split:
    """One signal of one trial, measured against simulated.

    Attributes:
        signal: name of the signal.
        squares: mean square of each component of the gap, m² or rad².
        travel: measured and simulated travel per cycle, m or rad; None where the drive has no period.
        size: size of the motion about its travel, measured over simulated.
        delay_s: how much later than simulated the motion comes, s.
        by_phase: RMS of the gap inside the cycle, drift removed, at each share of the gait's cycle,
            m or rad, shape (PHASE_BINS,); NaN where nothing was measured; empty where the drive has no
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


@dataclass(frozen=True)
class GapShare:
    """One component of the gap of one signal of one trial.

    Attributes:
        signal: name of the signal.
        trial: name of the trial.
        component: one of `COMPONENTS`.
        share: its share of the squared gaps of all trials that count, each in its floors.
        share_of_signal: its share of the squared gap of this signal in this trial.
        gap: RMS of the component, in `unit`.
        unit: ``m`` or ``rad``.
        floors: RMS of the component over the signal's floor; None where there is no floor.
    """

    signal: str
    trial: str
    component: str
    share: float
    share_of_signal: float
    gap: float
    unit: str
    floors: float | None

    def to_dict(self) -> dict[str, str | float | None]:
        """Return the row for a JSON file."""
        return asdict(self)


def gap_shares(trials: Iterable[tuple[str, Mapping[str, Split], Floors]]) -> list[GapShare]:
    """Return the components of the gaps of some trials, the largest share first; nothing of no gap.

    Args:
        trials: name, splits and floors of each trial that counts.
    """
    shares = [
        _gap_share(name, splits[signal], component, floors[signal].total)
        for name, splits, floors in trials
        for signal in splits
        for component in COMPONENTS
    ]
    total = sum(one.share for one in shares) or 1.0
    present = [replace(one, share=one.share / total) for one in shares if one.gap > 0.0]
    return sorted(present, key=lambda one: -one.share)


def _gap_share(trial: str, part: Split, component: str, floor: float) -> GapShare:
    """Return one component, its share not yet divided by the sum of all."""
    rms = math.sqrt(part.squares[component])
    return GapShare(
        part.signal,
        trial,
        component,
        (rms / floor) ** 2 if floor > 0.0 else 0.0,
        part.squares[component] / (part.rms**2 or 1.0),
        rms,
        unit_of(part.signal),
        rms / floor if floor > 0.0 else None,
    )


def split(aligned: Aligned, signal: str, transient: float, extra: Mapping[str, float]) -> Split:
    """Split the gap of one signal into its components; their squares add up to its mean square.

    Args:
        aligned: the trial beside its prediction.
        signal: the signal.
        transient: gait time at which the motion may be steady, s.
        extra: mean square that defects put into the record, by the component they belong to; added.

    Raises:
        GaitoptError: fewer than two cycles can be used.
    """
    if aligned.trial.drive.period_s is None:
        return _of_recording(aligned, signal, extra)
    return _of_cycles(aligned, signal, transient, aligned.trial.drive.period_s, extra)


def _of_cycles(
    aligned: Aligned, signal: str, transient: float, period: float, extra: Mapping[str, float]
) -> Split:
    """Split the gap of one signal of a gait."""
    trial = aligned.trial
    keep = trial.used[signal]
    time, residual = aligned.time[keep], aligned.residual[signal][keep]
    cycles = Cycles.of(time, period, transient, trial.name)
    measured = cycles.sampled(time, trial.signals[signal][keep], trial.frame_s)
    simulated = np.interp(cycles.times, aligned.simulated.time, aligned.simulated[signal])
    simulated = np.where(np.isfinite(measured), simulated, np.nan)
    travel, shape, _ = steady(measured)
    travel_simulated, shape_simulated, _ = steady(simulated)
    delay, size = _delay_and_size(shape, shape_simulated, lambda cycles: shifted(shape_simulated, cycles))
    _, _, rest = steady(measured - simulated)

    squares = _line(travel - travel_simulated, (size - 1.0) * travel_simulated, time, period)
    delayed = shifted(shape_simulated, delay)
    noise = float(np.nanmean(rest**2)) * cycles.count / (cycles.count - 1)
    squares["timing"] = float(np.mean((delayed - shape_simulated) ** 2))
    squares["stride"] += max(0.0, float(np.mean((shape - delayed) ** 2)) - noise / cycles.count)
    squares["stride"] += (
        float(np.mean(residual)) ** 2
    )  # an angle is off throughout; a marker's origin is free
    squares["noise"] = noise
    squares["transient"] = _transient(time, residual, cycles, measured - simulated, noise)
    return Split(
        signal,
        _added_up(squares, residual, extra),
        (travel, travel_simulated),
        size,
        delay * period,
        _by_phase(cycles, measured - simulated, float(np.mean(residual))),
    )


def _of_recording(aligned: Aligned, signal: str, extra: Mapping[str, float]) -> Split:
    """Split the gap of one signal of commands without a period: the whole recording is its one shape."""
    trial, simulated, block = aligned.trial, aligned.simulated, aligned.trial.drive.block_s
    keep = trial.used[signal]
    time, residual = aligned.time[keep], aligned.residual[signal][keep]
    measured, predicted = trial.signals[signal][keep], aligned.predicted[signal][keep]

    def delayed_by(blocks: float) -> Series:
        return without_line(time, np.interp(time - block * blocks, simulated.time, simulated[signal]))

    shape, shape_simulated = without_line(time, measured), without_line(time, predicted)
    delay, size = _delay_and_size(shape, shape_simulated, delayed_by)
    travel, travel_simulated = (block * float(np.polyfit(time, s, 1)[0]) for s in (measured, predicted))
    squares = _line(travel - travel_simulated, (size - 1.0) * travel_simulated, time, block)
    delayed, noise = delayed_by(delay), noise_of(measured) ** 2
    squares["timing"] = float(np.mean((delayed - shape_simulated) ** 2))
    squares["stride"] += max(0.0, float(np.mean((shape - delayed) ** 2)) - noise)
    squares["stride"] += float(np.mean(residual)) ** 2
    squares["noise"], squares["transient"] = noise, 0.0
    total = _added_up(squares, residual, extra)
    return Split(signal, total, None, size, delay * block, np.empty(0))


def _added_up(squares: Mapping[str, float], residual: Series, extra: Mapping[str, float]) -> dict[str, float]:
    """Return the components as shares of the gap, and what defects put into each added.

    The parts overlap a little; together they are the gap, so each is given its share of that.
    """
    scale = float(np.mean(residual**2)) / (sum(squares.values()) or 1.0)
    return {name: scale * squares[name] + extra.get(name, 0.0) for name in COMPONENTS}


def _delay_and_size(
    shape: Series, simulated: Series, delayed_by: Callable[[float], Series]
) -> tuple[float, float]:
    """Return the delay, in blocks, and the size that bring the simulated shape onto the measured one.

    Both are neutral where the measured motion does not resemble the simulated one.

    Args:
        shape: the measured motion.
        simulated: the simulated motion.
        delayed_by: the simulated motion later by a delay in blocks.
    """
    best, delay, size = float(np.mean((shape - simulated) ** 2)), 0.0, 1.0
    for candidate in np.linspace(-_LARGEST_DELAY, _LARGEST_DELAY, _DELAYS).tolist():
        delayed = delayed_by(candidate)
        power = float(delayed @ delayed)
        scale = float(delayed @ shape) / power if power > 0.0 else 1.0
        error = float(np.mean((shape - scale * delayed) ** 2))
        if error < best:
            best, delay, size = error, candidate, scale
    resembles = best < 0.5 * float(np.mean(shape**2))
    return (delay, size) if resembles else (0.0, 1.0)


def _line(difference: float, by_size: float, time: Series, period: float) -> dict[str, float]:
    """Return the squares of a difference in travel per cycle: what the stride's size explains, and drift.

    The size explains a part between nothing and the whole of the difference, never more.
    """
    explained = float(np.clip(by_size / difference, 0.0, 1.0)) if difference else 0.0
    elapsed = np.maximum(time, 0.0) / period
    square = difference**2 * float(elapsed.var())
    return {"stride": explained * square, "drift": (1.0 - explained) * square}


def _transient(time: Series, residual: Series, cycles: Cycles, rows: Series, noise: float) -> float:
    """Return the mean square, over all samples, by which those before the whole cycles stray from them."""
    early = time < cycles.begin
    if not early.any():
        return 0.0
    travel, shape, _ = steady(rows)
    turns = (time - cycles.begin) / cycles.period
    pattern = np.interp(np.mod(turns, 1.0), np.arange(PHASES) / PHASES, shape, period=1.0) + travel * turns
    stray = residual - pattern
    stray = stray - stray[~early].mean()
    return max(0.0, float((stray[early] ** 2).sum()) - noise * int(early.sum())) / len(time)


def _by_phase(cycles: Cycles, rows: Series, mean: float) -> Series:
    """Return the RMS at each share of the gait's cycle, travel removed, about the residual's `mean`."""
    travel, _, _ = steady(rows)
    flat = rows - travel * (np.arange(cycles.count)[:, None] + np.arange(PHASES)[None, :] / PHASES)
    flat = flat - np.nanmean(cycle_means(flat)) + mean
    bins = np.broadcast_to((cycles.phases * PHASE_BINS).astype(int), flat.shape)
    finite = np.isfinite(flat)
    counts = np.bincount(bins[finite], minlength=PHASE_BINS)
    squares = np.bincount(bins[finite], flat[finite] ** 2, minlength=PHASE_BINS)
    means = np.divide(squares, counts, out=np.full(PHASE_BINS, np.nan), where=counts > 0)
    by_phase: Series = np.sqrt(means)
    return by_phase
