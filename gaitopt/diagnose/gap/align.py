"""A trial aligned with its prediction: the unknown origin and the unknown offset in time are fitted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.gap.settings import DEFAULT, AlignSettings
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory

LONGEST_OFFSET_S = 2.0
"""Longest offset between the clocks of a log of commands and of a recording, s."""

_LEAST_SQUARE = 1e-5
"""Mean squared difference of a signal, in its spread, below which no simulation is exact."""


@dataclass(frozen=True)
class Aligned:
    """A trial aligned with its prediction, in gait time.

    Attributes:
        trial: the trial.
        simulated: the prediction, from gait time 0 on.
        offset_s: gait time at the recording's zero, s, given or fitted.
        time: gait time of each sample, s, shape (n,).
        predicted: for each signal the prediction at those times, m or rad, shape (n,). The marker's is moved
            to the measured origin.
        residual: for each signal measured minus predicted, m or rad, shape (n,). The marker's has zero mean;
            NaN where a sample does not count.
    """

    trial: Trial
    simulated: Trajectory
    offset_s: float
    time: Series
    predicted: Mapping[str, Series]
    residual: Mapping[str, Series]

    def first(self, count: int) -> Aligned:
        """Return the trial with its first samples alone."""
        predicted = {name: series[:count] for name, series in self.predicted.items()}
        residual = {name: series[:count] for name, series in self.residual.items()}
        return replace(
            self,
            trial=self.trial.first(count),
            time=self.time[:count],
            predicted=predicted,
            residual=residual,
        )

    def rms(self, signal: str) -> float:
        """Return the RMS of a signal's residual, m or rad."""
        return float(np.sqrt(np.nanmean(self.residual[signal] ** 2)))

    @property
    def marker_rms(self) -> float:
        """RMS distance between measured and predicted marker over the measured axes, m."""
        return float(np.sqrt(sum(self.rms(name) ** 2 for name in self.trial.signals if is_position(name))))


def square_apart(one: Trajectory, other: Trajectory, signal: str) -> float:
    """Return the mean squared difference of a signal, m² or rad²; a marker's origin is removed."""
    apart = one[signal] - np.interp(one.time, other.time, other[signal])
    return float(apart.var() if is_position(signal) else np.mean(apart**2))


def align(trial: Trial, simulated: Trajectory, settings: AlignSettings = DEFAULT.align) -> Aligned:
    """Return a trial aligned with a prediction, its origin and its offset in time fitted.

    The origin of the marker's coordinates is free, that of angles is not. Where the gait time of the
    recording's start is unknown, offsets within `longest_offset` are tried. The best one makes the signals
    most probable about a line, so that a difference in speed does not matter. The size of each signal's error
    is unknown, so a joint that follows its commands tells more than a marker that drifts to one side.

    Args:
        trial: the trial.
        simulated: its prediction, from gait time 0 on.
        settings: see `AlignSettings`.

    Raises:
        GaitoptError: the simulation failed.
    """
    if simulated.status != "ok" or len(simulated.time) == 0:
        raise GaitoptError(f"trial {trial.name}: the simulation of its gait {simulated.status}")
    offset = trial.starts_at_s if trial.starts_at_s is not None else best_offset(trial, simulated, settings)
    time = trial.time + offset
    predicted, residual = {}, {}
    for name, series in trial.signals.items():
        raw = np.interp(time, simulated.time, simulated[name])
        difference = np.where(trial.used[name], series - raw, np.nan)
        origin = float(np.nanmean(difference)) if is_position(name) else 0.0
        predicted[name], residual[name] = raw + origin, difference - origin
    return Aligned(trial, simulated, offset, time, predicted, residual)


def best_offset(trial: Trial, simulated: Trajectory, settings: AlignSettings = DEFAULT.align) -> float:
    """Return the gait time at the recording's zero that fits best, s."""
    cost = _Unlike(trial, simulated).improbability
    longest = longest_offset(trial)
    offsets = np.linspace(-longest, longest, settings.offsets)
    best = int(np.argmin([cost(offset) for offset in offsets.tolist()]))
    bounds = (float(offsets[max(0, best - 1)]), float(offsets[min(len(offsets) - 1, best + 1)]))
    refined = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": settings.precision_s})
    return float(refined.x)


def unlike(trial: Trial, simulated: Trajectory, offset: float) -> float:
    """Return the mean squared difference of measured and predicted signals, about a line, in their spreads.

    Args:
        trial: the trial.
        simulated: a prediction.
        offset: gait time at the recording's zero, s.
    """
    return _Unlike(trial, simulated).total(offset) / len(trial.signals)


class _Unlike:
    """How unlike a recording and a prediction are, at any offset in time."""

    def __init__(self, trial: Trial, simulated: Trajectory):
        self._time, self._terms = simulated.time, []
        for name in trial.signals:
            time, series = trial.counted(name)
            measured = without_line(time, series)
            scale = float(np.sqrt(np.mean(measured**2))) or 1.0
            self._terms.append((time, measured / scale, simulated[name] / scale))

    def total(self, offset: float) -> float:
        """Return the sum over the signals."""
        return sum(self._squares(offset))

    def improbability(self, offset: float) -> float:
        """Return minus twice the logarithm of the probability of a sample, up to a constant.

        Errors are taken to be Gaussian and as large as they are found to be, in each signal by itself.
        """
        return sum(math.log(max(square, _LEAST_SQUARE)) for square in self._squares(offset))

    def _squares(self, offset: float) -> list[float]:
        return [
            float(np.mean((measured - without_line(time, np.interp(time + offset, self._time, s))) ** 2))
            for time, measured, s in self._terms
        ]


def longest_offset(trial: Trial) -> float:
    """Return how far from gait time 0 a recording with an unknown start may begin, before or after it, s.

    It is one cycle of a gait. Commands without a period were logged by another clock: it is half of the
    recording, and no more than `LONGEST_OFFSET_S`.
    """
    if trial.drive.period_s is not None:
        return trial.drive.block_s
    return min(LONGEST_OFFSET_S, 0.5 * float(trial.time[-1] - trial.time[0]))


def without_line(time: Series, series: Series) -> Series:
    """Return a series minus its least-squares line over time."""
    centred = time - time.mean()
    below = float(centred @ centred)
    slope = float(centred @ series) / below if below > 0.0 else 0.0
    flat: Series = series - series.mean() - slope * centred
    return flat


def pooled_marker_rms(trials: Sequence[Aligned]) -> float:
    """Return the RMS marker error over all samples of some trials, m; 0 where no marker was measured."""
    total, samples = 0.0, 0
    for aligned in trials:
        counts = [np.isfinite(aligned.residual[n]).sum() for n in aligned.residual if is_position(n)]
        if counts:
            total += aligned.marker_rms**2 * int(max(counts))
            samples += int(max(counts))
    return float(np.sqrt(total / samples)) if samples else 0.0


def pooled_angle_rms(trials: Sequence[Aligned]) -> float:
    """Return the RMS error of the angles over all samples of some trials, rad; 0 where none was measured."""
    squares = [
        residual[np.isfinite(residual)] ** 2
        for aligned in trials
        for name, residual in aligned.residual.items()
        if not is_position(name)
    ]
    pooled = np.concatenate([np.empty(0), *squares])
    return float(np.sqrt(pooled.mean())) if len(pooled) else 0.0
