"""Gain, bias, lag, drift and a limit of the speed, fitted to a measured and a simulated curve."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.settings import CommandSplitSettings
from gaitopt.diagnose.record.trial import Flags, Series
from gaitopt.robot.signals import is_position

LARGEST_SIZE = 100.0
"""Largest size of a motion beside one that hardly moves."""


@dataclass(frozen=True)
class Pair:
    """A measured curve, and a simulated one that the components found so far bring nearer to it.

    Attributes:
        time: gait time of each sample that counts, s, shape (n,).
        measured: the measured curve at these times, m or rad, shape (n,).
        grid: times of the simulated curve, s, shape (m,): evenly spaced, wider than the samples.
        simulated: the simulated curve, m or rad, shape (m,).
        residual: what is left at each sample, m or rad, shape (n,).
        at_limit: which samples are at the limit of the motion, shape (n,).
        top_speed: largest speed of the signal in all trials, measured or simulated, whichever is slower, m/s
            or rad/s.
        free_origin: whether only changes count, as of the marker.
        frame_s: typical time between two samples, s.
    """

    time: Series
    measured: Series
    grid: Series
    simulated: Series
    residual: Series
    at_limit: Flags
    top_speed: float
    free_origin: bool
    frame_s: float

    @staticmethod
    def of(
        aligned: Aligned, signal: str, at_limit: Flags, top_speed: float, settings: CommandSplitSettings
    ) -> Pair:
        """Return measured and simulated curve of a signal.

        Args:
            aligned: the trial aligned with its prediction.
            signal: the signal.
            at_limit: which samples that count are at the limit of the motion, shape (n,).
            top_speed: see `Pair.top_speed`.
            settings: see `CommandSplitSettings`.
        """
        keep, path = np.isfinite(aligned.residual[signal]), aligned.simulated
        time = aligned.time[keep]
        span, frame = float(time[-1] - time[0]), aligned.trial.frame_s
        step = max(frame / settings.points_per_frame, span / settings.points)
        around = _longest_lag(time, settings)
        grid = np.arange(time[0] - around, time[-1] + around + step, step)
        simulated = np.interp(grid, path.time, path[signal])
        # Beyond its end, the simulation goes on at its last speed.
        beyond = np.maximum(grid - path.time[-1], 0.0)
        last = np.interp(path.time[-1] - frame, path.time, path[signal])
        simulated = simulated + beyond * (float(path[signal][-1]) - float(last)) / frame
        measured, residual = aligned.trial.signals[signal][keep], aligned.residual[signal][keep]
        free = is_position(signal)
        return Pair(time, measured, grid, simulated, residual, at_limit, top_speed, free, frame)

    @property
    def square(self) -> float:
        """Mean square of the residual, m² or rad²."""
        return float(np.mean(self.residual**2))

    @property
    def mostly_free(self) -> bool:
        """Whether most samples are off the limit. On it, distances grow and stay without any offset."""
        return float(self.at_limit.mean()) < 0.5

    @property
    def on_grid(self) -> Series:
        """The measured curve at the times of the simulated one, shape (m,)."""
        found: Series = np.interp(self.grid, self.time, self.measured)
        return found

    @property
    def predicted(self) -> Series:
        """The simulated curve at the samples, shape (n,)."""
        return self.at(self.time)

    def at(self, time: Series) -> Series:
        """Return the simulated curve at some times, shape of `time`."""
        found: Series = np.interp(time, self.grid, self.simulated)
        return found

    def centred(self, change: Series) -> Series:
        """Return a change of a curve at the samples; where the origin is free, without its mean."""
        return change - change.mean(axis=-1, keepdims=True) if self.free_origin else change

    def with_simulated(self, simulated: Series) -> Pair:
        """Return the pair with another simulated curve, shape (m,)."""
        change = np.interp(self.time, self.grid, simulated) - self.predicted
        return replace(self, simulated=simulated, residual=self.residual - self.centred(change))

    def with_measured(self, measured: Series) -> Pair:
        """Return the pair with another measured curve, shape (n,)."""
        change = self.centred(measured - self.measured)
        return replace(self, measured=measured, residual=self.residual + change)


@dataclass(frozen=True)
class Fitted:
    """What the fitted components remove.

    Attributes:
        pair: the curves with what was found.
        squares: mean square that each component removed, m² or rad².
        size: size of the motion, measured over simulated.
        delay_s: how much later than simulated the motion comes, s.
    """

    pair: Pair
    squares: dict[str, float]
    size: float = 1.0
    delay_s: float = 0.0


def fit(start: Pair, noise: float, settings: CommandSplitSettings) -> Fitted:
    """Fit gain, bias, lag, drift and limit one after the other, the one that removes most first.

    Args:
        start: the curves.
        noise: standard deviation of the measured one's noise, m or rad.
        settings: see `CommandSplitSettings`.
    """
    fitted = Fitted(start, {})
    least = max(settings.least * start.square, settings.chance * noise**2 / len(start.time))
    for _ in range(settings.rounds):
        tried = [candidate for one in _FITS for candidate in one(fitted, settings)]
        name, best = min(tried, key=lambda one: one[1].pair.square)
        if name == "drift":
            others = [one for one in tried if one[0] != "drift"]
            other = min(others, key=lambda one: one[1].pair.square, default=(name, best))
            if best.pair.square > settings.plain * other[1].pair.square:
                name, best = other
        removed = fitted.pair.square - best.pair.square
        if removed <= least:
            break
        squares = fitted.squares | {name: fitted.squares.get(name, 0.0) + removed}
        fitted = replace(best, squares=squares)
    return fitted


_Candidates = Iterator[tuple[str, Fitted]]


def _bias(fitted: Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the constant offset that fits best; where the origin is free, there is none."""
    pair = fitted.pair
    if not pair.free_origin and pair.mostly_free:
        yield "bias", replace(fitted, pair=pair.with_simulated(pair.simulated + pair.residual.mean()))


def _gain(fitted: Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the size of the motion since the start that fits best.

    Where the simulated joint hardly moves, no size of its motion can fit. The measured motion is then as much
    larger as it must shrink to fit.
    """
    pair = fitted.pair
    start = pair.at(pair.time[:1])
    moved, seen = pair.centred(pair.predicted - start), pair.centred(pair.measured - pair.measured[0])
    power, power_seen = float(moved @ moved), float(seen @ seen)
    if power > settings.still**2 * power_seen:
        size = 1.0 + float(moved @ pair.residual) / power
        resized = pair.with_simulated(start + size * (pair.simulated - start))
        yield "gain", replace(fitted, pair=resized, size=fitted.size * size)
    elif power_seen > 0.0:
        share = 1.0 - float(seen @ pair.residual) / power_seen
        shrunk = pair.with_measured(pair.measured[0] + share * (pair.measured - pair.measured[0]))
        yield "gain", replace(fitted, pair=shrunk, size=fitted.size / max(share, 1.0 / LARGEST_SIZE))


def _lag(fitted: Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the delay that fits best."""
    pair = fitted.pair
    longest = _longest_lag(pair.time, settings)
    delays = np.linspace(-longest, longest, settings.delays) - fitted.delay_s
    best, _ = _best_delay(pair, delays)
    near = np.linspace(-1.0, 1.0, settings.finer) * (delays[1] - delays[0])
    delay, moved = _best_delay(pair, best + near)
    yield "lag", replace(fitted, pair=moved, delay_s=fitted.delay_s + delay)


def _longest_lag(time: Series, settings: CommandSplitSettings) -> float:
    """Return the longest delay that is tried, s."""
    return min(settings.longest_lag_s, settings.longest_lag * float(time[-1] - time[0]))


def _best_delay(pair: Pair, delays: Series) -> tuple[float, Pair]:
    """Return the delay, s, after which the curves are nearest, and the delayed pair."""
    later = pair.at(pair.time - delays[:, None])
    left = pair.residual - pair.centred(later - pair.predicted)
    delay = float(delays[_nearest(left)])
    return delay, pair.with_simulated(pair.at(pair.grid - delay))


def _drift(fitted: Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the line from the start that fits best; in a short recording nothing is slow."""
    pair = fitted.pair
    elapsed = pair.centred(pair.time - pair.time[0])
    if pair.mostly_free and pair.time[-1] - pair.time[0] >= settings.slow_s:
        slope = float(elapsed @ pair.residual) / (float(elapsed @ elapsed) or 1.0)
        line = slope * np.maximum(pair.grid - pair.time[0], 0.0)
        yield "drift", replace(fitted, pair=pair.with_simulated(pair.simulated + line))


def _limit(fitted: Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the limit of the speed that brings the curves nearest, put on either of them."""
    pair = fitted.pair
    if pair.free_origin:
        return
    simulated = _limiting(pair, pair.on_grid, pair.simulated, 1.0, settings)
    if simulated is not None:
        yield "saturation", replace(fitted, pair=pair.with_simulated(pair.simulated + simulated))
    measured = _limiting(pair, pair.simulated, pair.on_grid, -1.0, settings)
    if measured is not None:
        change = np.interp(pair.time, pair.grid, measured)
        yield "saturation", replace(fitted, pair=pair.with_measured(pair.measured + change))


def _limiting(
    pair: Pair, slow: Series, quick: Series, sign: float, settings: CommandSplitSettings
) -> Series | None:
    """Return what the limit of speed that fits best changes in the quicker curve, shape (m,).

    None if the slower curve does not run at that speed where the limit changes the quicker one.

    Args:
        pair: the two curves.
        slow: the slower of them on the grid, m or rad, shape (m,).
        quick: the quicker of them.
        sign: 1 if the quicker one is the simulated one, -1 if it is the measured one.
        settings: see `CommandSplitSettings`.
    """
    begin, end = np.searchsorted(pair.grid, [pair.time[0], pair.time[-1]])
    during = slice(int(begin), int(end) + 1)
    time, slow = pair.grid[during], slow[during]
    later, earlier = (np.interp(time + frames * pair.frame_s, time, slow) for frames in (1.0, -1.0))
    speed = np.abs(later - earlier) / (2.0 * pair.frame_s)
    limits = np.array(settings.limits) * float(speed.max())
    limits = limits[limits >= settings.slowest_limit * pair.top_speed]
    if not len(limits):
        return None
    changes = limited(time, quick[during], limits) - quick[during]
    behind = np.abs(changes) > settings.behind * np.ptp(slow)
    near = np.abs(speed - limits[:, None]) < settings.near_limit * limits[:, None]
    runs_there = (near & behind).sum(axis=1) > settings.at_limit * np.maximum(1, behind.sum(axis=1))
    if not runs_there.any():
        return None
    changes = changes[runs_there]
    at_samples = np.stack([np.interp(pair.time, time, change) for change in changes])
    change = np.zeros(len(pair.grid))
    change[during] = changes[_nearest(pair.residual - sign * at_samples)]
    return change


def _nearest(residuals: Series) -> int:
    """Return the index of the row with the least squares."""
    return int(np.argmin((residuals**2).mean(axis=1)))


_FITS: tuple[Callable[[Fitted, CommandSplitSettings], _Candidates], ...] = (
    _bias,
    _gain,
    _lag,
    _drift,
    _limit,
)
"""The components that are fitted; of two that remove the same, the first is taken."""


def limited(time: Series, series: Series, speeds: Series) -> Series:
    """Return a series followed no faster than some speeds, shape (speeds, n).

    Args:
        time: s, shape (n,).
        series: the series, shape (n,).
        speeds: the largest speeds, in units of the series per second, shape (speeds,).
    """
    reach = np.diff(time)[:, None] * speeds
    rows = np.empty((len(time), len(speeds)))
    rows[0] = at = np.full(len(speeds), series[0])
    for index, step in enumerate(reach, 1):
        at = at + np.minimum(np.maximum(series[index] - at, -step), step)
        rows[index] = at
    return rows.T
