"""Intervals of the mean: by Student's t from samples, by the normal distribution from standard errors.

Standard deviations that some odd values do not change.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

UNIFORM_WIDTH = math.sqrt(12.0)
"""Width of a uniform distribution over its standard deviation; its mean, from 0 on, is half of the width."""

NORMAL_95 = 1.645
"""95 % point of the standard normal distribution, rounded: plus and minus this many standard errors are
a 90 % interval."""

_NORMAL_MAD = 1.4826
"""Standard deviation of a normal distribution over the median of the sizes of its deviations."""


def spread90(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the interval that one more value of the same kind lies in, in 9 of 10 cases.

    Its ends are the ranks r of n sorted values with r / (n + 1) = 0.05 and 0.95, whatever the distribution
    (Weibull 1939; Hyndman and Fan 1996, type 6). Fewer than 19 values have no such ranks: then the ends are
    the smallest and the largest value, and the interval holds one more in (n - 1) / (n + 1) of the cases.

    Args:
        values: the values, shape (n,); those that are not finite are left out.

    Returns:
        Its ends; NaN where there are no values.
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.nan, np.nan
    low, high = np.quantile(finite, (0.05, 0.95), method="weibull")
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


def robust_sd(deviations: NDArray[np.float64]) -> float:
    """Return the standard deviation of normally distributed deviations from 0, by the median of their sizes.

    Args:
        deviations: shape (n,); those that are not finite are left out.

    Returns:
        It, in their unit; NaN where there are none.
    """
    sizes = np.abs(deviations[np.isfinite(deviations)])
    return float(_NORMAL_MAD * np.median(sizes)) if len(sizes) else math.nan


def noise_sd(series: NDArray[np.float64], order: int) -> float:
    """Return the standard deviation of a series' white noise, by the median size of its differences.

    That is insensitive to motion, which is smooth or rare.

    Args:
        series: evenly sampled, shape (n,); NaN in gaps.
        order: order of the differences; the higher, the more of a motion it leaves out.

    Returns:
        It, in the series' unit; NaN where no samples follow one another.
    """
    return robust_sd(np.diff(series, order)) / math.sqrt(math.comb(2 * order, order))


def explained_by_groups(values: NDArray[np.float64], outcomes: NDArray[np.float64], groups: int) -> float:
    """Return the share of the variance of outcomes that a value explains by itself (epsilon squared).

    The values are divided into groups of about equal numbers, so the dependence may have any shape. What
    chance alone is expected to explain is subtracted (Kelley 1935, PNAS 21: 554).

    Args:
        values: the values, shape (n,).
        outcomes: what may depend on them, shape (n,), n more than `groups`.
        groups: number of groups, at most.

    Returns:
        A share from 0 to 1.
    """
    edges = np.quantile(values, np.linspace(0.0, 1.0, groups + 1)[1:-1])
    _, group = np.unique(np.searchsorted(edges, values, side="right"), return_inverse=True)
    counts = np.bincount(group)
    means = np.bincount(group, outcomes) / counts
    total = float(((outcomes - outcomes.mean()) ** 2).sum())
    within = float(((outcomes - means[group]) ** 2).sum())
    free = len(outcomes) - len(counts)
    if total <= 0.0 or len(counts) < 2 or free <= 0:
        return 0.0
    by_chance = (len(counts) - 1) * within / free
    return max(0.0, (total - within - by_chance) / total)


def uniform_sd(width: float) -> float:
    """Return the standard deviation of what lies anywhere in a range, or was rounded to steps so wide."""
    return width / UNIFORM_WIDTH
