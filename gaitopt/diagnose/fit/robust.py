"""The loss of a set of effects: a Student's t for each trial, and an error that all trials share.

The covariance of a trial says how far off a correct model may be. No model of a real servo or robot is
correct, and one trial may have slipped, lost a command or been misnamed. So

- a model may be off by an error of the same size, in rad, in all trials. It adds to the covariance of each,
  and has the size that makes the recordings most probable: none, if the model fits down to the floor;
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
        errors: sizes of the shared error that are tried, rad; 0 among them.
        scales: factor on the variance of each trial, shape (trials,); None for 1.
    """

    row_trials: NDArray[np.intp]
    freedom: float
    temper: float
    most_rows: float
    per_error: Array
    errors: tuple[float, ...] = (0.0,)
    scales: Array | None = None

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

    def of_squares(self, squares: Array) -> Array:
        """Return the loss of each trial from its sum of squares, shape (trials,)."""
        losses = self._losses(squares)
        least: Array = losses[int(np.argmin(losses.sum(axis=1)))]
        return least

    def total(self, whitened: Array) -> float:
        """Return the loss of all trials, minus twice a logarithm of a likelihood."""
        return float(self.of_squares(self.squares(whitened)).sum())

    def shared_error(self, squares: Array) -> float:
        """Return the size of the error that all trials share, rad, from their sums of squares."""
        return self.errors[int(np.argmin(self._losses(squares).sum(axis=1)))]

    def trial_weights(self, squares: Array) -> Array:
        """Return the weight of each trial in the least squares that lower the loss, shape (trials,).

        Args:
            squares: sum of squares of each trial, shape (trials,).
        """
        variances = self._variances[self.errors.index(self.shared_error(squares))]
        n, v = self.rows / self.tempers, self.freedom
        weights: Array = (v + n) / (v + squares / variances / self.tempers) / self.tempers / variances
        return weights

    @cached_property
    def _variances(self) -> Array:
        """Factor on the variance of each trial with each shared error, shape (errors, trials)."""
        own = np.ones(len(self.rows)) if self.scales is None else self.scales
        variances: Array = own + np.square(self.errors)[:, None] * self.per_error
        return variances

    def _losses(self, squares: Array) -> Array:
        """Return the loss of each trial with each shared error, shape (errors, trials)."""
        n, v = self.rows / self.tempers, self.freedom
        fitted = (v + n) * np.log1p(squares / self._variances / self.tempers / v)
        losses: Array = fitted + n * np.log(self._variances)
        return losses
