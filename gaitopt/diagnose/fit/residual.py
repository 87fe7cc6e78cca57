"""Residuals that can be added up: a trial against a prediction, whitened by a covariance.

A trial is averaged over bins of a block (a cycle, where there are cycles), its signals side by side in order
of time. The covariance S of these bins says how far off a correct model may be. Its parts are the camera's
noise, the differences between cycles, and the marker's free origin. Further parts are the change of the
prediction with small errors (start pose, masses, timestep, cone), and a smooth remainder of similar size.
With S = L L', the whitened residual

    z = L^-1 (measured - predicted)

has unit variance if the model is correct. In order of time, each entry is the part that the earlier ones do
not predict. So cycles can be resampled, left out and added up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.bins import Bins
from gaitopt.diagnose.fit.covariance import measurement_covariance, robot_covariance
from gaitopt.diagnose.fit.settings import WHITENING, WhiteningSettings
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.gap.predict import latest_gait_time
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory

Array = NDArray[np.float64]


_ERROR_PERIOD_S = 0.4
"""Period of the waves that stand, with a constant, for a smooth error of a model, s."""


@dataclass(frozen=True)
class TrialResiduals:
    """One trial compared with one prediction.

    Attributes:
        whitened: whitened residual, shape (rows,).
        marker: measured minus predicted of each sample of the marker, m, its mean removed, shape (samples,).
        angles: measured minus predicted of each sample of the angles, rad, shape (samples,).
    """

    whitened: Array
    marker: Array
    angles: Array


@dataclass(frozen=True)
class WhitenedTrial:
    """One trial, ready to be compared with any prediction of it.

    Attributes:
        aligned: the trial aligned with the nominal prediction.
        bins: its rows.
        whitener: inverse of the lower Cholesky factor of the covariance, shape (n, n).
        measurement: covariance of noise, spread and origin, which no robot changes, m² and rad², shape (n,
            n).
        settings: how the covariance is made.
    """

    aligned: Aligned
    bins: Bins
    whitener: Array
    measurement: Array
    settings: WhiteningSettings = WHITENING

    @staticmethod
    def of(
        aligned: Aligned,
        floors: Floors,
        perturbed: Sequence[Trajectory],
        settings: WhiteningSettings = WHITENING,
    ) -> WhitenedTrial:
        """Return a trial with the covariance from some perturbed robots.

        Args:
            aligned: the trial aligned with the nominal prediction.
            floors: floor of each signal.
            perturbed: predictions of the trial by robots with small errors.
            settings: how the covariance is made.
        """
        bins = Bins.of(aligned, settings)
        nominal = bins.means(aligned.simulated, aligned.offset_s)
        changes = [
            bins.means(other, aligned.offset_s) - nominal for other in perturbed if other.status == "ok"
        ]
        if not changes:
            name = aligned.trial.name
            raise GaitoptError(
                f"trial {name}: no robot with small errors can be simulated; see `gaitopt check`"
            )
        measurement = measurement_covariance(aligned, floors, bins, nominal, settings)
        robots = robot_covariance(aligned, bins, np.array(changes), settings)
        factor = cholesky(measurement + robots, lower=True)
        whitener = np.ascontiguousarray(solve_triangular(factor, np.eye(len(factor)), lower=True))
        return WhitenedTrial(aligned, bins, whitener, measurement, settings)

    @property
    def latest_s(self) -> float:
        """Latest gait time that a comparison needs, s."""
        settings, trial = self.settings, self.aligned.trial
        if trial.starts_at_s is not None:
            return latest_gait_time(trial)
        moved = settings.offset_steps * settings.offset_max_blocks * trial.drive.block_s
        return min(float(self.aligned.time[-1]) + moved, latest_gait_time(trial))

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return len(self.bins.counts)

    @property
    def motion(self) -> float:
        """Mean square of the whitened motion: what was measured, about the mean of each signal."""
        moved = self.bins.measured.copy()
        for index in np.unique(self.bins.signal):
            own = self.bins.signal == index
            moved[own] -= moved[own].mean()
        return float(np.mean(self._whiten(moved) ** 2))

    @property
    def per_error(self) -> float:
        """Mean whitened square of a smooth error of 1 rad, or of 0.1 m where positions were measured."""
        names = list(self.bins.rows)
        size = np.array([0.1 if is_position(name) else 1.0 for name in names])[self.bins.signal]
        phase = 2.0 * np.pi * self.bins.time / _ERROR_PERIOD_S
        shapes = (np.ones(self.n_rows), np.sqrt(2.0) * np.sin(phase), np.sqrt(2.0) * np.cos(phase))
        return float(np.mean([np.mean(self._whiten(size * shape) ** 2) for shape in shapes]))

    def whitening_update(self, changes: Array) -> Array:
        """Return the whitening update for a new covariance.

        Args:
            changes: whitened changes with the perturbed robots that give the covariance, shape (robots, n).

        Returns:
            Lower triangular matrix from rows whitened by `whitener` to rows whitened by the new covariance,
            shape (n, n).
        """
        factor = solve_triangular(self.whitener, np.eye(self.n_rows), lower=True)
        robots = robot_covariance(self.aligned, self.bins, changes @ factor.T, self.settings)
        update: Array = solve_triangular(cholesky(self.measurement + robots, lower=True), factor, lower=True)
        return update

    def in_measurement_errors(self, rows: Array) -> Array:
        """Return rows whitened by `whitener` as whitened by the measurement's covariance alone.

        Args:
            rows: rows of this trial, or columns of them, shape (n,) or (n, k).
        """
        raw = solve_triangular(self.whitener, rows, lower=True)
        found: Array = solve_triangular(cholesky(self.measurement, lower=True), raw, lower=True)
        return found

    def with_errors_along(self, columns: Array) -> WhitenedTrial:
        """Return the trial with further errors, which no robot changes, in its covariance.

        Args:
            columns: responses whose sizes are unknown with a standard deviation of 1, shape (n, k).
        """
        further = columns @ columns.T
        factor = solve_triangular(self.whitener, np.eye(self.n_rows), lower=True)
        whole = cholesky(factor @ factor.T + further, lower=True)
        whitener = np.ascontiguousarray(solve_triangular(whole, np.eye(self.n_rows), lower=True))
        return replace(self, whitener=whitener, measurement=self.measurement + further)

    def head(self, seconds: float) -> WhitenedTrial:
        """Return the beginning of the trial: a part of it as long as this or as one block, s.

        Rows are in order of time, and each is whitened by the rows before it, so they stay as they are.
        """
        longest = max(seconds, self.aligned.trial.drive.block_s)
        bins = self.bins.until(float(self.aligned.time[0]) + longest)
        ends = [time[-1] for time in bins.sample_times.values() if len(time)]
        count = int(np.searchsorted(self.aligned.trial.time, max(ends), side="right"))
        rows = slice(len(bins.counts))
        return replace(
            self,
            aligned=self.aligned.first(count),
            bins=bins,
            whitener=np.ascontiguousarray(self.whitener[rows, rows]),
            measurement=self.measurement[rows, rows],
        )

    def compare(self, trajectory: Trajectory) -> TrialResiduals | None:
        """Return the trial compared with a prediction; None where the simulation failed."""
        if trajectory.status != "ok" or len(trajectory.time) == 0:
            return None
        known = self.aligned.trial.starts_at_s is not None
        offset = self.aligned.offset_s if known else self._best_offset(trajectory)
        return TrialResiduals(self._whitened(trajectory, offset), *self._samples(trajectory, offset))

    def _whitened(self, trajectory: Trajectory, offset: float) -> Array:
        return self._whiten(self.bins.measured - self.bins.means(trajectory, offset))

    def _whiten(self, rows: Array) -> Array:
        white: Array = self.whitener @ rows
        return white

    def _best_offset(self, trajectory: Trajectory) -> float:
        """Return the offset of the least whitened residual, by Gauss–Newton from the nominal one."""
        settings = self.settings
        offset, delta = self.aligned.offset_s, settings.offset_difference_s
        longest = settings.offset_max_blocks * self.aligned.trial.drive.block_s
        white = self._whitened(trajectory, offset)
        for _ in range(settings.offset_steps):
            later = self.bins.means(trajectory, offset + delta)
            sooner = self.bins.means(trajectory, offset - delta)
            slope = self._whiten((later - sooner) / (2.0 * delta))
            wanted = float(white @ slope) / max(float(slope @ slope), 1e-12)
            step = min(max(wanted, -longest), longest)
            tried = self._whitened(trajectory, offset + step)
            if float(tried @ tried) >= float(white @ white):
                break
            offset, white = offset + step, tried
            if abs(step) < settings.offset_tolerance_s:
                break
        return offset

    def _samples(self, trajectory: Trajectory, offset: float) -> tuple[Array, Array]:
        """Return the residual of each sample: of the marker, m, and of the angles, rad."""
        trial = self.aligned.trial
        kinds: dict[bool, list[Array]] = {True: [np.empty(0)], False: [np.empty(0)]}
        for name in trial.signals:
            keep = trial.used[name]
            predicted = np.interp(trial.time[keep] + offset, trajectory.time, trajectory[name])
            residual = trial.signals[name][keep] - predicted
            kinds[is_position(name)].append(residual - residual.mean() if is_position(name) else residual)
        return np.concatenate(kinds[True]), np.concatenate(kinds[False])


def by_signal(trials: Sequence[WhitenedTrial], marker: Array, angles: Array) -> list[dict[str, Array]]:
    """Return the samples of several trials, one after another, split by trial and signal.

    Args:
        trials: the trials, in order.
        marker: the marker's residuals of all of them, m, shape (samples,).
        angles: the angles' residuals, rad, shape (samples,).
    """
    left, found = {True: marker, False: angles}, []
    for one in trials:
        trial, parts = one.aligned.trial, {}
        for name in trial.signals:
            kind, count = is_position(name), int(trial.used[name].sum())
            parts[name], left[kind] = left[kind][:count], left[kind][count:]
        found.append(parts)
    return found
