"""The gap of one signal under commands without a period, split into eight components.

- gain: the motion since the start is larger or smaller than simulated, by one factor.
- bias: the measured angle lies beside the simulated one by a constant.
- lag: the same motion comes later or earlier.
- drift: the distance grows or falls slowly over the recording.
- saturation: the motion is slower or faster than simulated where it runs at its limit.
- overshoot: the motion soon after a change of command has another shape: it overshoots or rings.
- stick_slip: the motion advances in steps where the command is smooth.
- noise: of the measurement.

Gain, bias, lag, drift and a limit of the speed are fitted one after the other, the one that removes most of
the residual first. The mean square that each removes is its share. What they leave, apart from noise, is
divided by time. At the limit it is saturation; soon after a jump of the command it is overshoot. Elsewhere
its slow part is drift. Its fast part is stick and slip where the command is smooth, and overshoot where it is
not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.leftover import shares_by_time
from gaitopt.diagnose.gap.settings import DEFAULT, CommandSplitSettings
from gaitopt.diagnose.gap.split import Split
from gaitopt.diagnose.record.trial import Series
from gaitopt.robot.signals import is_position

COMMAND_COMPONENTS = ("gain", "bias", "lag", "overshoot", "stick_slip", "saturation", "drift", "noise")

_OF_DEFECTS = {"timing": "lag", "noise": "noise"}
"""Component of a drive without a period, by the component that a defect of the record names."""


def split_commands(
    aligned: Aligned,
    signal: str,
    noise: float,
    extra: Mapping[str, float],
    settings: CommandSplitSettings = DEFAULT.split_commands,
) -> Split:
    """Split the gap of one signal into its components; their squares add up to its mean square.

    Args:
        aligned: the trial aligned with its prediction.
        signal: the signal.
        noise: standard deviation of the signal's noise, m or rad.
        extra: mean square that defects put into the record, by the component they belong to; it is added.
        settings: see `CommandSplitSettings`.
    """
    start = _Pair.of(aligned, signal, settings)
    fitted = _fit(start, noise, settings)
    squares = fitted.squares | {"noise": min(noise**2, fitted.pair.square)}
    left = fitted.pair.square - squares["noise"]
    for name, share in shares_by_time(aligned, signal, fitted.pair.residual, settings).items():
        squares[name] = squares.get(name, 0.0) + share * left
    for name, component in _OF_DEFECTS.items():
        squares[component] = squares.get(component, 0.0) + extra.get(name, 0.0)
    ordered = {name: squares.get(name, 0.0) for name in COMMAND_COMPONENTS}
    return Split(signal, ordered, None, fitted.size, fitted.delay_s, np.empty(0))


@dataclass(frozen=True)
class _Pair:
    """A measured curve, and a simulated one that the components found so far bring nearer to it.

    Attributes:
        time: gait time of each sample that counts, s, shape (n,).
        measured: the measured curve at these times, m or rad, shape (n,).
        grid: times of the simulated curve, s, shape (m,): evenly spaced, wider than the samples.
        simulated: the simulated curve, m or rad, shape (m,).
        residual: what is left at each sample, m or rad, shape (n,).
        free_origin: whether only changes count, as of the marker.
        frame_s: typical time between two samples, s.
    """

    time: Series
    measured: Series
    grid: Series
    simulated: Series
    residual: Series
    free_origin: bool
    frame_s: float

    @staticmethod
    def of(aligned: Aligned, signal: str, settings: CommandSplitSettings) -> _Pair:
        """Return measured and simulated curve of a signal."""
        keep = np.isfinite(aligned.residual[signal])
        time = aligned.time[keep]
        span = float(time[-1] - time[0])
        step = max(aligned.trial.frame_s / settings.points_per_frame, span / settings.points)
        around = _longest_lag(time, settings)
        grid = np.arange(time[0] - around, time[-1] + around + step, step)
        simulated = np.interp(grid, aligned.simulated.time, aligned.simulated[signal])
        measured, residual = aligned.trial.signals[signal][keep], aligned.residual[signal][keep]
        return _Pair(time, measured, grid, simulated, residual, is_position(signal), aligned.trial.frame_s)

    @property
    def square(self) -> float:
        """Mean square of the residual, m² or rad²."""
        return float(np.mean(self.residual**2))

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

    def with_simulated(self, simulated: Series) -> _Pair:
        """Return the pair with another simulated curve, shape (m,)."""
        change = np.interp(self.time, self.grid, simulated) - self.predicted
        return replace(self, simulated=simulated, residual=self.residual - self.centred(change))

    def with_measured(self, measured: Series) -> _Pair:
        """Return the pair with another measured curve, shape (n,)."""
        change = self.centred(measured - self.measured)
        return replace(self, measured=measured, residual=self.residual + change)


@dataclass(frozen=True)
class _Fitted:
    """What the fitted components remove.

    Attributes:
        pair: the curves with what was found.
        squares: mean square that each component removed, m² or rad².
        size: size of the motion, measured over simulated.
        delay_s: how much later than simulated the motion comes, s.
    """

    pair: _Pair
    squares: dict[str, float]
    size: float = 1.0
    delay_s: float = 0.0


def _fit(start: _Pair, noise: float, settings: CommandSplitSettings) -> _Fitted:
    """Fit gain, bias, lag, drift and limit one after the other, the one that removes most first."""
    fitted = _Fitted(start, {})
    least = max(settings.least * start.square, settings.chance * noise**2 / len(start.time))
    for _ in range(settings.rounds):
        tried = [candidate for fit in _FITS for candidate in fit(fitted, settings)]
        name, best = min(tried, key=lambda one: one[1].pair.square)
        removed = fitted.pair.square - best.pair.square
        if removed <= least:
            break
        squares = fitted.squares | {name: fitted.squares.get(name, 0.0) + removed}
        fitted = replace(best, squares=squares)
    return fitted


_Candidates = Iterator[tuple[str, _Fitted]]


def _bias(fitted: _Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the constant offset that fits best; where the origin is free, there is none."""
    pair = fitted.pair
    if not pair.free_origin:
        yield "bias", replace(fitted, pair=pair.with_simulated(pair.simulated + pair.residual.mean()))


def _gain(fitted: _Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the size of the motion since the start that fits best."""
    pair = fitted.pair
    start = pair.at(pair.time[:1])
    moved = pair.centred(pair.predicted - start)
    power = float(moved @ moved)
    if power > 0.0:
        size = 1.0 + float(moved @ pair.residual) / power
        resized = pair.with_simulated(start + size * (pair.simulated - start))
        yield "gain", replace(fitted, pair=resized, size=fitted.size * size)


def _lag(fitted: _Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the delay that fits best."""
    pair = fitted.pair
    longest = _longest_lag(pair.time, settings)
    delays = np.linspace(-longest, longest, settings.delays)
    best, _ = _best_delay(pair, delays)
    near = np.linspace(-1.0, 1.0, settings.finer) * (delays[1] - delays[0])
    delay, moved = _best_delay(pair, best + near)
    yield "lag", replace(fitted, pair=moved, delay_s=fitted.delay_s + delay)


def _longest_lag(time: Series, settings: CommandSplitSettings) -> float:
    """Return the longest delay that is tried, s."""
    return min(settings.longest_lag_s, settings.longest_lag * float(time[-1] - time[0]))


def _best_delay(pair: _Pair, delays: Series) -> tuple[float, _Pair]:
    """Return the delay, s, after which the curves are nearest, and the delayed pair."""
    later = pair.at(pair.time - delays[:, None])
    left = pair.residual - pair.centred(later - pair.predicted)
    delay = float(delays[_nearest(left)])
    return delay, pair.with_simulated(pair.at(pair.grid - delay))


def _drift(fitted: _Fitted, settings: CommandSplitSettings) -> _Candidates:
    """Yield the line from the start that fits best."""
    pair = fitted.pair
    elapsed = pair.centred(pair.time - pair.time[0])
    slope = float(elapsed @ pair.residual) / (float(elapsed @ elapsed) or 1.0)
    line = slope * np.maximum(pair.grid - pair.time[0], 0.0)
    yield "drift", replace(fitted, pair=pair.with_simulated(pair.simulated + line))


def _limit(fitted: _Fitted, settings: CommandSplitSettings) -> _Candidates:
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
    pair: _Pair, slow: Series, quick: Series, sign: float, settings: CommandSplitSettings
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


_FITS: tuple[Callable[[_Fitted, CommandSplitSettings], _Candidates], ...] = (
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
