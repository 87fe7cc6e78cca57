"""The loss of a set of effects: a Student's t for each trial, and an error that all trials share.

The covariance of a trial says how far off a correct model may be. No model of a real servo or robot is
correct, and one trial may have slipped, lost a command or been misnamed. So

- a model may be off by an error that all trials share: a size in rad, and a share of the trial's motion. It
  adds to the covariance of each, and has the size and share that make the recordings most probable: none,
  if the model fits down to the floor;
- the covariance of each trial is known up to a factor, which has an inverse-gamma prior. With that factor
  integrated out, n whitened rows with the sum of squares s have the density of a multivariate Student's t
  with v degrees of freedom: -2 log p = (v + n) log(1 + s / v) + constant.

A trial that no model fits then counts little, and a trial that fits better than the others do is not fitted
at their cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RobustLoss:
    """The loss of whitened residuals.

    Attributes:
        row_trials: trial of each row, from 0, shape (rows,).
        freedom: degrees of freedom v.
        temper: number of rows that count as one: the residual of a nearly correct model is correlated.
        most_rows: a trial counts as this many such rows at most: where a model is not quite right, a longer
            recording repeats the same error.
        per_error: mean whitened square of a smooth error of 1 rad in each trial, shape (trials,).
        per_motion: mean whitened square of each trial's motion about its mean, shape (trials,).
        errors: shared errors that are tried: each a size, rad, and a share of the motion.
    """

    row_trials: NDArray[np.intp]
    freedom: float
    temper: float
    most_rows: float
    per_error: Array
    per_motion: Array
    errors: tuple[tuple[float, float], ...] = ((0.0, 0.0),)

    @cached_property
    def rows(self) -> Array:
        """Number of rows of each trial, shape (trials,)."""
        counts: Array = np.bincount(self.row_trials).astype(float)
        return counts

    @cached_property
    def tempers(self) -> Array:
        """Number of rows that count as one in each trial, shape (trials,)."""
        tempers: Array = np.maximum(self.temper, self.rows / self.most_rows)
        return tempers

    def squares(self, whitened: Array) -> Array:
        """Return the sum of squares of each trial, shape (trials,)."""
        sums: Array = np.bincount(self.row_trials, whitened**2, minlength=len(self.rows)).astype(float)
        return sums

    def mean_squares(self, whitened: Array) -> Array:
        """Return the mean square of each trial, shape (trials,)."""
        means: Array = self.squares(whitened) / self.rows
        return means

    def of_squares(self, squares: Array) -> Array:
        """Return the loss of each trial from its sum of squares, shape (trials,)."""
        losses = self._losses(squares)
        least: Array = losses[int(np.argmin(losses.sum(axis=1)))]
        return least

    def of_each(self, whitened: Array) -> Array:
        """Return the loss of each trial, shape (trials,)."""
        return self.of_squares(self.squares(whitened))

    def weights_of(self, whitened: Array) -> Array:
        """Return `trial_weights` of a whitened residual, shape (trials,)."""
        return self.trial_weights(self.squares(whitened))

    def total(self, whitened: Array) -> float:
        """Return the loss of all trials, minus twice a logarithm of a likelihood."""
        return float(self.of_each(whitened).sum())

    def totals(self, whitened: Array) -> Array:
        """Return the loss of all trials for each of many residuals, shape (residuals,).

        Args:
            whitened: the residuals, shape (residuals, rows).
        """
        of_trials = self.row_trials == np.arange(len(self.rows))[:, None]
        squares = np.square(whitened) @ of_trials.T.astype(float)
        totals: Array = self._losses(squares[:, None]).sum(axis=-1).min(axis=-1)
        return totals

    def shared_error(self, squares: Array) -> tuple[float, float]:
        """Return the error that all trials share from their sums of squares: rad, and share of the motion."""
        return self.errors[self._likeliest(squares)]

    def trial_weights(self, squares: Array) -> Array:
        """Return the weight of each trial in the least squares that lower the loss, shape (trials,).

        Args:
            squares: sum of squares of each trial, shape (trials,).
        """
        variances = self._variances[self._likeliest(squares)]
        n, v = self.rows / self.tempers, self.freedom
        weights: Array = (v + n) / (v + squares / variances / self.tempers) / self.tempers / variances
        return weights

    @cached_property
    def _variances(self) -> Array:
        """Factor on the variance of each trial with each shared error, shape (errors, trials)."""
        sizes, shares = np.square(self.errors).T
        variances: Array = 1.0 + np.outer(sizes, self.per_error) + np.outer(shares, self.per_motion)
        return variances

    def _likeliest(self, squares: Array) -> int:
        return int(np.argmin(self._losses(squares).sum(axis=1)))

    def _losses(self, squares: Array) -> Array:
        """Return the loss of each trial with each shared error, shape (..., errors, trials)."""
        n, v = self.rows / self.tempers, self.freedom
        fitted = (v + n) * np.log1p(squares / self._variances / self.tempers / v)
        losses: Array = fitted + self._constants
        return losses

    @cached_property
    def _constants(self) -> Array:
        """The part of `_losses` that does not depend on squares, shape (errors, trials)."""
        constants: Array = self.rows / self.tempers * np.log(self._variances)
        return constants


@dataclass(frozen=True)
class WideLoss(RobustLoss):
    """The loss where the covariance of each trial is wide enough for a correct model, or too wide.

    What a set leaves below the covariance is no evidence that the covariance is smaller: an effect would then
    be blamed for what the tolerances allow. So the factor on the covariance of each trial is the likeliest
    one that is at least 1, and a trial that nothing fits counts by the logarithm of what it leaves.
    """

    def trial_weights(self, squares: Array) -> Array:
        """Return the weight of each trial in the least squares that lower the loss, shape (trials,)."""
        variances = self._variances[self._likeliest(squares)]
        weights: Array = 1.0 / self._factors(squares / variances) / self.tempers / variances
        return weights

    def _factors(self, squares: Array) -> Array:
        factors: Array = np.maximum(1.0, squares / self.rows)
        return factors

    def _losses(self, squares: Array) -> Array:
        scaled, n = squares / self._variances, self.rows / self.tempers
        factors = self._factors(scaled)
        losses: Array = n * (np.log(factors * self._variances) + scaled / self.rows / factors)
        return losses
