"""Sums over blocks of rows, and the inner products on which a step of a fit depends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RowBlocks:
    """The blocks and trials of rows.

    Attributes:
        of_rows: block of each row, from 0, shape (rows,).
        trials: trial of each block, from 0, shape (blocks,).
    """

    of_rows: NDArray[np.intp]
    trials: NDArray[np.intp]

    def sums(self, of_rows: Array) -> Array:
        """Return the sum of a value of each row over each block, shape (blocks,)."""
        sums: Array = np.bincount(self.of_rows, of_rows, minlength=len(self.trials)).astype(float)
        return sums

    def by_trial(self, of_blocks: Array) -> Array:
        """Return the sums over each trial of values of each block, shape (blocks, ...)."""
        totals = np.zeros((int(self.trials[-1]) + 1, *of_blocks.shape[1:]))
        np.add.at(totals, self.trials, of_blocks)
        return totals


@dataclass(frozen=True)
class Products:
    """Inner products of a residual and its slopes, block by block: all that a step depends on.

    Attributes:
        residual: of the residual with itself, shape (blocks,).
        mixed: of the slopes with the residual, shape (blocks, k).
        slopes: of the slopes with each other, shape (blocks, k, k).
    """

    residual: Array
    mixed: Array
    slopes: Array

    @staticmethod
    def of(whitened: Array, slopes: Array, rows: RowBlocks) -> Products:
        """Return the products of a residual, shape (rows,), and its slopes, shape (rows, k)."""
        count = slopes.shape[1]
        both = np.column_stack([whitened, slopes])
        grams = np.empty((len(rows.trials), count + 1, count + 1))
        for i in range(count + 1):
            for j in range(i + 1):
                grams[:, i, j] = grams[:, j, i] = rows.sums(both[:, i] * both[:, j])
        return Products(grams[:, 0, 0], grams[:, 1:, 0], grams[:, 1:, 1:])

    def squares(self, step: Array) -> Array:
        """Return the sum of squares of each block after a step, in ranges, shape (blocks,)."""
        after = self.residual + 2.0 * self.mixed @ step + (self.slopes @ step) @ step
        squares: Array = np.maximum(after, 0.0)
        return squares
