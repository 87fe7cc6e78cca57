"""A small Gaussian process: Matérn 5/2, fixed length, fixed size, noise of each measurement.

Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), chapters 2 and 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

Array = NDArray[np.float64]

_JITTER = 1e-10
"""Added to the diagonal, as a share of the variance, so that equal points do no harm."""


def matern(points: Array, others: Array, length: float) -> Array:
    """Return the correlation of two sets of points by the Matérn kernel of smoothness 5/2.

    Args:
        points: shape (n, d).
        others: shape (m, d).
        length: length scale.

    Returns:
        Correlations, shape (n, m).
    """
    apart = math.sqrt(5.0) / length * cdist(points, others)
    correlation: Array = (1.0 + apart + apart**2 / 3.0) * np.exp(-apart)
    return correlation


@dataclass(frozen=True)
class Conditioned:
    """A process of zero mean at some points, after measurements at others.

    Attributes:
        points: the points, shape (points, d).
        gain: what is expected at the points for each unit measured, shape (points, measured).
        across: covariance of the points and the measurements, shape (points, measured).
        measured: covariance of the measurements, noise included, shape (measured, measured).
        variance: variance of the process.
        length: its length scale.
    """

    points: Array
    gain: Array
    across: Array
    measured: Array
    variance: float
    length: float

    @staticmethod
    def of(points: Array, at: Array, noise: Array, variance: float, length: float) -> Conditioned:
        """Return a process at points, shape (n, d), after measurements.

        Args:
            points: where it is wanted, shape (n, d).
            at: where it was measured, shape (m, d); m may be 0.
            noise: variance of the noise of each measurement, shape (m,).
            variance: variance of the process.
            length: its length scale.
        """
        across = variance * matern(points, at, length)
        measured = variance * matern(at, at, length) + np.diag(noise + _JITTER * variance)
        gain: Array = np.zeros((len(points), 0))
        if len(at):
            gain = np.asarray(np.linalg.solve(measured, across.T).T, dtype=float)
        return Conditioned(points, gain, across, measured, variance, length)

    @property
    def covariance(self) -> Array:
        """What is left unknown at the points, shape (points, points)."""
        left: Array = (
            self.variance * matern(self.points, self.points, self.length) - self.gain @ self.across.T
        )
        return left

    @property
    def deviation(self) -> Array:
        """Standard deviation at each point, shape (points,)."""
        left = self.variance - np.sum(self.gain * self.across, axis=1)
        deviation: Array = np.sqrt(np.maximum(left, 0.0))
        return deviation
