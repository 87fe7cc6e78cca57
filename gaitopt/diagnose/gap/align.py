"""The nuisances: a recording's unknown origin, and its offset in time where no sync mark was filmed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.trial import Trial
from gaitopt.robot.signals import is_marker
from gaitopt.robot.trajectory import Trajectory

Series = NDArray[np.float64]

_OFFSETS = 401
"""Offsets tried over two blocks before the best is refined: 5 ms apart at 1 s."""

_PRECISION_S = 1e-5


@dataclass(frozen=True)
class Aligned:
    """A trial beside its prediction, on the gait's clock.

    Attributes:
        trial: the trial.
        simulated: the prediction, from gait time 0 on.
        offset_s: gait time at the recording's zero, s, given or fitted.
        time: gait time of each sample, s, shape (n,).
        predicted: for each signal the prediction at those times, the marker's moved to the measured
            origin, shape (n,).
        residual: measured minus predicted, the marker's of zero mean; NaN where a sample does not count,
            shape (n,).
    """

    trial: Trial
    simulated: Trajectory
    offset_s: float
    time: Series
    predicted: Mapping[str, Series]
    residual: Mapping[str, Series]

    def rms(self, signal: str) -> float:
        """Return the RMS of a signal's residual, m or rad."""
        return float(np.sqrt(np.nanmean(self.residual[signal] ** 2)))

    @property
    def marker_rms(self) -> float:
        """RMS distance between measured and predicted marker over the axes measured, m."""
        return float(np.sqrt(sum(self.rms(name) ** 2 for name in self.trial.signals if is_marker(name))))


def square_apart(one: Trajectory, other: Trajectory, signal: str) -> float:
    """Return the mean squared difference of a signal, the marker's origin removed, m² or rad²."""
    apart = one[signal] - np.interp(one.time, other.time, other[signal])
    return float(apart.var() if is_marker(signal) else np.mean(apart**2))


def align(trial: Trial, simulated: Trajectory) -> Aligned:
    """Return a trial beside a prediction, its nuisances fitted.

    The origin of the marker's coordinates is free, that of angles is not. Where the gait time of the
    recording's start is unknown, the offset between one block before and one after is taken that
    leaves the least squared residual about a line, so that a difference in speed does not pull at it;
    signals weigh alike, each by its own spread.

    Raises:
        GaitoptError: the simulation failed.
    """
    if simulated.status != "ok" or len(simulated.time) == 0:
        raise GaitoptError(f"trial {trial.name}: the simulation of its gait {simulated.status}")
    offset = trial.starts_at_s if trial.starts_at_s is not None else _best_offset(trial, simulated)
    time = trial.time + offset
    predicted, residual = {}, {}
    for name, series in trial.signals.items():
        raw = np.interp(time, simulated.time, simulated[name])
        difference = np.where(trial.used[name], series - raw, np.nan)
        origin = float(np.nanmean(difference)) if is_marker(name) else 0.0
        predicted[name], residual[name] = raw + origin, difference - origin
    return Aligned(trial, simulated, offset, time, predicted, residual)


def _best_offset(trial: Trial, simulated: Trajectory) -> float:
    terms = []
    for name, series in trial.signals.items():
        keep = trial.used[name]
        time = trial.time[keep]
        measured = without_line(time, series[keep])
        scale = float(np.sqrt(np.mean(measured**2))) or 1.0
        terms.append((time, measured / scale, simulated[name] / scale))

    def cost(offset: float) -> float:
        return sum(
            float(np.mean((measured - without_line(time, np.interp(time + offset, simulated.time, s))) ** 2))
            for time, measured, s in terms
        )

    offsets = np.linspace(-trial.drive.block_s, trial.drive.block_s, _OFFSETS)
    best = int(np.argmin([cost(offset) for offset in offsets.tolist()]))
    bounds = (float(offsets[max(0, best - 1)]), float(offsets[min(len(offsets) - 1, best + 1)]))
    refined = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": _PRECISION_S})
    return float(refined.x)


def without_line(time: Series, series: Series) -> Series:
    """Return a series about its least-squares line over time."""
    centred = time - time.mean()
    below = float(centred @ centred)
    slope = float(centred @ series) / below if below > 0.0 else 0.0
    flat: Series = series - series.mean() - slope * centred
    return flat


def pooled_marker_rms(trials: Sequence[Aligned]) -> float:
    """Return the RMS marker error over all samples of some trials, m; 0 where no marker was measured."""
    total, samples = 0.0, 0
    for aligned in trials:
        counts = [np.isfinite(aligned.residual[n]).sum() for n in aligned.residual if is_marker(n)]
        if counts:
            total += aligned.marker_rms**2 * int(max(counts))
            samples += int(max(counts))
    return float(np.sqrt(total / samples)) if samples else 0.0
