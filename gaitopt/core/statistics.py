"""Intervals of the mean: by Student's t from samples, by the normal distribution from standard errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

NORMAL_95 = 1.645
"""95 % point of the standard normal distribution, rounded: plus and minus this many standard errors are
a 90 % interval."""


def spread90(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the interval that holds the middle 90 % of some values; NaN where there are none.

    Args:
        values: the values, shape (n,); those that are not finite are left out.
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.nan, np.nan
    low, high = np.quantile(finite, (0.05, 0.95))
    return float(low), float(high)


def half_width90(values: NDArray[np.float64]) -> float:
    """Return half the width of the 90 % interval of the mean, by Student's t.

    Args:
        values: independent values, shape (n,), n at least 2.

    Returns:
        The half width, in the unit of the values.
    """
    return float(stats.t.ppf(0.95, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values)))


def interval90(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the 90 % interval of the mean of independent values, by Student's t.

    Args:
        values: the values, shape (n,). A single value is both ends of its interval.
    """
    mean = float(values.mean())
    if len(values) < 2:
        return mean, mean
    half = half_width90(values)
    return mean - half, mean + half
