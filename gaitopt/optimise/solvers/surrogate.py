"""A surrogate: which of many candidates promise most, judged by what was evaluated near them.

Radial functions interpolate the ranks of the costs; ranks, because one penalty is as large as a thousand
differences in speed. It is as good as the evaluations around a candidate, so it chooses among candidates
and never stands in for an evaluation. What it is worth: ``results/rivals``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.stats import rankdata

from gaitopt.optimise.solvers.solution import Point

_NEIGHBOURS = 60
"""A candidate is judged by this many evaluated points; what lies further away says little about it."""

_SMOOTHING = 1e-3
"""Lets the interpolation miss its points a little: near neighbours may differ by chaos alone."""


def most_promising(
    points: Point, costs: Point, candidates: Point, count: int, circular: NDArray[np.bool_]
) -> Point:
    """Return the `count` candidates of lowest predicted rank, best first, shape (count, d).

    Where fewer points were evaluated than there are coordinates, the first `count` candidates.

    Args:
        points: points that were evaluated, shape (n, d).
        costs: their costs, shape (n,).
        candidates: points to choose from, shape (m, d).
        count: how many to choose.
        circular: which coordinates are circular, shape (d,).
    """
    known, first = np.unique(_embedded(points, circular), axis=0, return_index=True)
    if len(known) <= points.shape[1]:
        return candidates[:count]
    ranks = rankdata(costs[first]) / len(first)
    predicted = RBFInterpolator(
        known,
        ranks,
        neighbors=min(_NEIGHBOURS, len(known)),
        kernel="linear",
        smoothing=_SMOOTHING,
        degree=0,
    )(_embedded(candidates, circular))
    chosen: Point = candidates[np.argsort(predicted, kind="stable")[:count]]
    return chosen


def _embedded(points: Point, circular: NDArray[np.bool_]) -> Point:
    """Return points in a space where near is near: a circle of diameter 0.64 for each phase."""
    angle = 2.0 * np.pi * points[:, circular]
    box = points[:, ~circular].clip(0.0, 1.0)
    return np.hstack([box, np.cos(angle) / np.pi, np.sin(angle) / np.pi])
