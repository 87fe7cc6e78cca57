"""The loss of a set of effects: a Student's t for each trial, whose scale is not known exactly.

The covariance of a trial says how far off a correct model may be. No model of a real servo or robot is
correct, and one trial may have slipped, lost a command or been misnamed. So the covariance of each trial is
known up to a factor, which has an inverse-gamma prior. With that factor integrated out, n whitened rows with
the sum of squares s have the density of a multivariate Student's t with v degrees of freedom:

    -2 log p = (v + n) log(1 + s / v) + constant.

A trial that no model fits then counts little, and an improvement by a tenth counts the same in a trial that
fits well as in one that fits badly.
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
    """

    row_trials: NDArray[np.intp]
    freedom: float
    temper: float
    most_rows: float
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
        return sums if self.scales is None else sums / self.scales

    def of_squares(self, squares: Array) -> Array:
        """Return the loss of each trial from its sum of squares, shape (trials,)."""
        n, v = self.rows / self.tempers, self.freedom
        losses: Array = (v + n) * np.log1p(squares / self.tempers / v)
        return losses

    def total(self, whitened: Array) -> float:
        """Return the loss of all trials, minus twice a logarithm of a likelihood."""
        return float(self.of_squares(self.squares(whitened)).sum())

    def weights(self, whitened: Array) -> Array:
        """Return the weight of each row in the least squares that lower the loss, shape (rows,)."""
        n, v = self.rows / self.tempers, self.freedom
        by_trial = (v + n) / (v + self.squares(whitened) / self.tempers) / self.tempers
        if self.scales is not None:
            by_trial = by_trial / self.scales
        weights: Array = by_trial[self.row_trials]
        return weights
