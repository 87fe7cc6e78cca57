"""How the whitened residual answers to the parameters near a robot that was simulated.

Contacts make it jagged: from one simulated robot to the next it jumps, which makes slopes over short
distances steep, and lets the luckiest of near robots win. So slopes are those of all near robots together,
and what the nearest are off them is chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.fitting import Comparison, Fit, TrialSet
from gaitopt.diagnose.fit.pairs import PairFit

Array = NDArray[np.float64]

_NEAR = 0.06
"""Share of a range within which simulated robots show together how a response changes."""

_CLOSE = 0.01
"""Robots nearer than this show no slope by themselves: on either side, one beyond counts too."""

_NEAREST = 3
"""So many of them show how it jumps: the others are off a line because it is curved."""

_APART = 0.002
"""Robots of a pair that are so close, in ranges, do not show two slopes."""


@dataclass(frozen=True)
class Response:
    """Slopes and jumps.

    Attributes:
        slopes: change of the whitened residual over each parameter's whole range, shape (rows, parameters).
        jump: square of what a near robot's residual is off them, the median.
        luck: by how much its loss of each trial is, the median, shape (trials,).
    """

    slopes: Array
    jump: float
    luck: Array


def of_fit(fit: Fit) -> Response:
    """Return the response near a fit's best robot."""
    best, h = fit.best(), fit.hypothesis
    nearest = min(fit.comparisons, key=lambda point: abs(float(point.at[0]) - best))
    return _response(fit.trial_set, fit.comparisons, nearest, np.array([h.high - h.low]), None)


def of_pair(pair: PairFit) -> Response:
    """Return the response near a pair's best robot."""
    return _response(
        pair.fits[0].trial_set, pair.comparisons, pair.best(), pair.spans, pair.slopes * pair.spans
    )


def _response(
    trial_set: TrialSet, points: Sequence[Comparison], best: Comparison, spans: Array, known: Array | None
) -> Response:
    """Return the response near a simulated robot; its slopes are `known` where too few robots are near."""
    moved = np.array([(point.at - best.at) / spans for point in points])
    changes = np.array([point.whitened - best.whitened for point in points])
    distance = np.abs(moved).max(axis=1)
    near = (distance > 0.0) & (distance <= _NEAR)
    shown = near.copy()
    if known is None:
        for side in (-1.0, 1.0):
            beyond = np.where(side * moved[:, 0] > 0.0, distance, np.inf)
            beyond[distance <= _CLOSE] = np.inf
            shown[np.argmin(beyond)] |= bool(np.isfinite(beyond).any())
    if known is None or np.linalg.matrix_rank(moved[shown], tol=_APART) == len(spans):
        slopes: Array = np.linalg.lstsq(moved[shown], changes[shown], rcond=None)[0].T
    else:
        slopes = known
    nearest = np.flatnonzero(near)[np.argsort(distance[near], kind="stable")][:_NEAREST]
    smooth = moved[nearest] @ slopes.T
    if not len(nearest):
        return Response(slopes, 0.0, np.zeros(trial_set.n_trials))
    jumps = np.sum((changes[nearest] - smooth) ** 2, axis=1)
    jumped, even = ([trial_set.of_trials(best.whitened + c) for c in by] for by in (changes[nearest], smooth))
    luck = np.abs(np.array(jumped) - np.array(even))
    return Response(slopes, float(np.median(jumps)), np.median(luck, axis=0))
