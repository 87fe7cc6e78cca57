"""A surrogate: it predicts which of many candidates are best from the evaluations near them.

Radial basis functions interpolate the ranks of the costs. Ranks are used because one penalty is as large as a
thousand differences in speed. The prediction is only as good as the evaluations near a candidate, so it
chooses among candidates and does not replace an evaluation. The gain is in ``results/rivals``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.stats import rankdata

from gaitopt.optimise.solvers.solution import Point


@dataclass(frozen=True)
class SurrogateSettings:
    """How candidates are judged.

    Attributes:
        neighbours: each candidate is judged by at most this many evaluated points; points further away say
            little about it.
        smoothing: lets the interpolation miss its points a little, because near neighbours may differ only by
            chaos.
    """

    neighbours: int = 60
    smoothing: float = 1e-3


def most_promising(
    points: Point,
    costs: Point,
    candidates: Point,
    count: int,
    circular: NDArray[np.bool_],
    settings: SurrogateSettings = SurrogateSettings(),
) -> Point:
    """Return the `count` candidates of lowest predicted rank, best first, shape (count, d).

    Where fewer points were evaluated than there are coordinates, the first `count` candidates.

    Args:
        points: points that were evaluated, shape (n, d).
        costs: their costs, shape (n,).
        candidates: points to choose from, shape (m, d).
        count: how many to choose.
        circular: which coordinates are circular, shape (d,).
        settings: how candidates are judged.
    """
    known, first = np.unique(embedded(points, circular), axis=0, return_index=True)
    if len(known) <= points.shape[1]:
        return candidates[:count]
    ranks = rankdata(costs[first]) / len(first)
    predicted = RBFInterpolator(
        known,
        ranks,
        neighbors=min(settings.neighbours, len(known)),
        kernel="linear",
        smoothing=settings.smoothing,
        degree=0,
    )(embedded(candidates, circular))
    chosen: Point = candidates[np.argsort(predicted, kind="stable")[:count]]
    return chosen


def embedded(points: Point, circular: NDArray[np.bool_]) -> Point:
    """Return points in a space of true distances: each phase becomes a circle of diameter 0.64."""
    angle = 2.0 * np.pi * points[:, circular]
    box = points[:, ~circular].clip(0.0, 1.0)
    return np.hstack([box, np.cos(angle) / np.pi, np.sin(angle) / np.pi])


def distance(one: Point, other: Point, circular: NDArray[np.bool_]) -> float:
    """Return the true distance of two points, both of shape (d,)."""
    points = embedded(np.array([one, other]), circular)
    return float(np.linalg.norm(points[0] - points[1]))
