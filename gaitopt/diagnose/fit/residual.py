"""Residuals that can be added up: a trial against a prediction, whitened by what a right model leaves.

A trial is averaged over bins of a cycle, its signals side by side in order of time. What keeps a right
model from fitting it is a covariance S of those bins: the camera's noise, the change of the prediction
with everything that nobody knows exactly (start pose, masses, timestep, cone), a smooth remainder of the
same size, cycles that differ, and the free origin of the marker. With S = L L', the whitened residual

    z = L^-1 (measured - predicted)

has unit variance where the model is right, and in order of time each of its entries is what the earlier
ones did not foretell: cycles can be resampled, left out and added up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.robot.signals import is_marker
from gaitopt.robot.trajectory import Trajectory

Array = NDArray[np.float64]

BINS = 20
"""Bins a block, a cycle where there are cycles, where frames allow."""

MOST_BINS = 160
"""Bins a trial at most: the covariance is a dense matrix."""

_ORIGIN_M = 0.05
_REMAINDER = 0.35
"""Size of the smooth remainder, in sizes of the change with nuisances."""

_REMAINDER_CYCLES = 0.1
_INFLATION = 1.5
"""The covariance of a few draws is too small by about this."""

_LEAST = {"marker": 1e-4, "joint": 1e-3}
"""Least error of a bin, m and rad: what a simulator of rigid boxes cannot mean."""

_STEPS = 4
_DIFFERENCE_S = 2e-3


@dataclass(frozen=True)
class TrialResiduals:
    """A trial beside one prediction.

    Attributes:
        whitened: shape (rows,).
        marker: measured minus predicted of each sample of the marker, m, its mean removed, shape
            (samples,).
        angles: the same of the angles, rad.
        offset_s: gait time at the recording's zero, s.
    """

    whitened: Array
    marker: Array
    angles: Array
    offset_s: float


@dataclass(frozen=True)
class WhitenedTrial:
    """One trial, ready to be compared with any prediction of it.

    Attributes:
        aligned: the trial beside the nominal prediction.
        rows: for each signal, the row of each sample that counts.
        counts: samples in each row, shape (n,).
        measured: mean of each row, m or rad, shape (n,).
        whitener: inverse of the lower Cholesky factor of the covariance, shape (n, n).
        cycles: cycle of each row, from 0, shape (n,).
        signal: signal of each row, by its number, shape (n,).
        time: gait time of each row, s, shape (n,).
        chance: covariance of what no robot makes, m² and rad², shape (n, n).
    """

    aligned: Aligned
    rows: dict[str, NDArray[np.intp]]
    counts: Array
    measured: Array
    whitener: Array
    cycles: NDArray[np.intp]
    signal: NDArray[np.int_]
    time: Array
    chance: Array

    @property
    def free(self) -> bool:
        """Whether the recording's offset is unknown."""
        return self.aligned.trial.starts_at_s is None

    def means(self, trajectory: Trajectory, offset: float) -> Array:
        """Return a prediction averaged over each row, m or rad, shape (n,)."""
        return _means(self.aligned, self.rows, self.counts, trajectory, offset)

    def whiten(self, rows: Array) -> Array:
        """Return rows of unit variance."""
        white: Array = self.whitener @ rows
        return white

    def whitening_update(self, changes: Array) -> Array:
        """Return what takes whitened rows to rows whitened by what other robots would have taught.

        Args:
            changes: whitened changes with these robots, shape (draws, n).

        Returns:
            A lower triangular matrix, shape (n, n).
        """
        factor = solve_triangular(self.whitener, np.eye(len(self.counts)), lower=True)
        robots = _of_robots(self.aligned, self.signal, self.time, changes @ factor.T)
        turn: Array = solve_triangular(cholesky(self.chance + robots, lower=True), factor, lower=True)
        return turn

    def compare(self, trajectory: Trajectory) -> TrialResiduals | None:
        """Return the trial beside a prediction; None where the simulation failed."""
        if trajectory.status != "ok" or len(trajectory.time) == 0:
            return None
        offset = self._offset(trajectory) if self.free else self.aligned.offset_s
        white = self.whiten(self.measured - self.means(trajectory, offset))
        apart, angles = self._samples(trajectory, offset)
        return TrialResiduals(white, apart, angles, offset)

    def _offset(self, trajectory: Trajectory) -> float:
        """Return the offset with the smallest whitened residual, by Gauss and Newton from the nominal's."""
        offset, most = self.aligned.offset_s, 0.1 * self.aligned.trial.drive.block_s
        white = self.whiten(self.measured - self.means(trajectory, offset))
        for _ in range(_STEPS):
            later = self.means(trajectory, offset + _DIFFERENCE_S)
            sooner = self.means(trajectory, offset - _DIFFERENCE_S)
            slope = self.whiten((later - sooner) / (2.0 * _DIFFERENCE_S))
            wanted = float(white @ slope) / max(float(slope @ slope), 1e-12)
            step = min(max(wanted, -most), most)
            tried = self.whiten(self.measured - self.means(trajectory, offset + step))
            if float(tried @ tried) >= float(white @ white):
                break
            offset, white = offset + step, tried
            if abs(step) < 1e-4:
                break
        return offset

    def _samples(self, trajectory: Trajectory, offset: float) -> tuple[Array, Array]:
        trial = self.aligned.trial
        kinds: dict[bool, list[Array]] = {True: [np.empty(0)], False: [np.empty(0)]}
        for name in trial.signals:
            keep = trial.used[name]
            predicted = np.interp(trial.time[keep] + offset, trajectory.time, trajectory[name])
            apart = trial.signals[name][keep] - predicted
            kinds[is_marker(name)].append(apart - apart.mean() if is_marker(name) else apart)
        return np.concatenate(kinds[True]), np.concatenate(kinds[False])


def by_signal(views: Sequence[WhitenedTrial], marker: Array, angles: Array) -> list[dict[str, Array]]:
    """Return the samples of `WhitenedTrial.compare` of several trials, by trial and signal.

    Args:
        views: the trials, in order.
        marker: the marker's residuals of all of them, m, shape (samples,).
        angles: the angles', rad.
    """
    left, found = {True: marker, False: angles}, []
    for one in views:
        trial, parts = one.aligned.trial, {}
        for name in trial.signals:
            kind, count = is_marker(name), int(trial.used[name].sum())
            parts[name], left[kind] = left[kind][:count], left[kind][count:]
        found.append(parts)
    return found


def whiten_trial(aligned: Aligned, floors: Floors, drawn: Sequence[Trajectory]) -> WhitenedTrial:
    """Return a trial ready for comparison.

    Args:
        aligned: the trial beside the nominal prediction.
        floors: floor of each signal.
        drawn: predictions of the trial by robots that differ in what nobody knows exactly.
    """
    trial = aligned.trial
    span = float(aligned.time[-1] - aligned.time[0])
    width = max(trial.drive.block_s / BINS, trial.frame_s, span / MOST_BINS)
    bins = {name: np.floor(aligned.time[trial.used[name]] / width).astype(int) for name in trial.signals}
    keys = sorted({(int(b), i) for i, name in enumerate(bins) for b in np.unique(bins[name])})
    place = {key: row for row, key in enumerate(keys)}
    rows = {
        name: np.array([place[int(b), i] for b in bins[name]], dtype=np.intp) for i, name in enumerate(bins)
    }
    counts = np.sum([np.bincount(r, minlength=len(keys)) for r in rows.values()], axis=0).astype(float)
    measured = sum(
        (np.bincount(rows[n], trial.signals[n][trial.used[n]], len(keys)) for n in rows), np.zeros(len(keys))
    )
    signal = np.array([i for _, i in keys])
    time = np.array([(b + 0.5) * width for b, _ in keys])
    nominal = _means(aligned, rows, counts, aligned.simulated, aligned.offset_s)
    changes = [
        _means(aligned, rows, counts, other, aligned.offset_s) - nominal
        for other in drawn
        if other.status == "ok"
    ]
    chance = _chance(aligned, floors, signal, time, counts)
    if aligned.trial.clock_s > 0.0:
        late = _means(aligned, rows, counts, aligned.simulated, aligned.offset_s + aligned.trial.clock_s)
        chance += np.outer(late - nominal, late - nominal)
    first = int(np.floor(time[0] / trial.drive.block_s))
    cycles = np.floor(time / trial.drive.block_s).astype(np.intp) - first
    factor = cholesky(chance + _of_robots(aligned, signal, time, np.array(changes)), lower=True)
    whitener = np.ascontiguousarray(solve_triangular(factor, np.eye(len(factor)), lower=True))
    return WhitenedTrial(aligned, rows, counts, measured / counts, whitener, cycles, signal, time, chance)


def _means(
    aligned: Aligned, rows: dict[str, NDArray[np.intp]], counts: Array, trajectory: Trajectory, offset: float
) -> Array:
    sums = np.zeros(len(counts))
    for name, row in rows.items():
        time = aligned.trial.time[aligned.trial.used[name]] + offset
        sums += np.bincount(row, np.interp(time, trajectory.time, trajectory[name]), len(counts))
    means: Array = sums / counts
    return means


def _of_robots(aligned: Aligned, signal: NDArray[np.int_], time: Array, changes: Array) -> Array:
    """Return the covariance of what nobody knows of a robot, with a smooth remainder of a like size.

    Args:
        aligned: the trial.
        signal: signal of each row, shape (n,).
        time: gait time of each row, s.
        changes: what drawn robots change, m and rad, shape (draws, n).
    """
    covariance: Array = _INFLATION * changes.T @ changes / len(changes)
    apart = np.abs(time[:, None] - time[None, :]) / aligned.trial.drive.block_s
    smooth = np.exp(-0.5 * (apart / _REMAINDER_CYCLES) ** 2)
    begin = min(float(time[0]), 0.0)
    elapsed = (time - begin) / max(float(time[-1]) - begin, 1e-9)
    wander = np.minimum(elapsed[:, None], elapsed[None, :])
    for index, name in enumerate(aligned.trial.signals):
        block = np.ix_(signal == index, signal == index)
        of_signal = changes[:, signal == index]
        if is_marker(name):
            of_signal = of_signal - of_signal.mean(axis=1, keepdims=True)
        size = float(np.mean(of_signal**2))
        covariance[block] += _REMAINDER**2 * size * (smooth[block] + 2.0 * wander[block])
    return covariance


def _chance(aligned: Aligned, floors: Floors, signal: NDArray[np.int_], time: Array, counts: Array) -> Array:
    """Return the covariance of noise, cycles that differ and the marker's free origin."""
    covariance = np.zeros((len(counts), len(counts)))
    within = np.exp(-np.abs(time[:, None] - time[None, :]) / aligned.trial.drive.block_s / 0.3)
    for index, name in enumerate(aligned.trial.signals):
        own = signal == index
        block, floor = np.ix_(own, own), floors[name]
        if floor.spread is not None:
            covariance[block] += max(0.0, floor.spread**2 - floor.noise**2) * within[block]
        if is_marker(name):
            covariance[block] += _ORIGIN_M**2
        diagonal = np.flatnonzero(own)
        least = _LEAST[name.partition(".")[0]]
        covariance[diagonal, diagonal] += floor.noise**2 / counts[own] + least**2
    return covariance


def rms(samples: Array) -> float:
    """Return the RMS of samples; 0 for none."""
    return math.sqrt(float(np.mean(samples**2))) if len(samples) else 0.0
