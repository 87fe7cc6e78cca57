"""How probable it is that a gait keeps the limits on where and how well it walks, which its film shows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.campaign.belief import Belief, Filmed
from gaitopt.campaign.robots import Walked
from gaitopt.campaign.settings import BeliefSettings
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SIDEWAYS_RATIO

Array = NDArray[np.float64]

_LARGEST = 1.0
"""A gait that drifts more than it walks forward is no better known by how much more."""


def most_drift(problem: Problem) -> float:
    """Return the largest drift that a problem allows; infinite where there is no limit on it."""
    limit = problem.objective.constraints.get(SIDEWAYS_RATIO)
    return math.inf if limit is None or limit.max is None else limit.max


def drifts_of(walked: Walked) -> Array:
    """Return sideways over forward travel of gaits on robots, left positive, shape (robots, gaits)."""
    forward = np.maximum(np.abs(walked.speeds), 1e-9)
    return bounded(walked.sideways / forward)


def bounded(drifts: Array) -> Array:
    """Return drifts of which those that are larger than any of use count as the largest one."""
    kept: Array = np.clip(drifts, -_LARGEST, _LARGEST)
    return kept


def within(drifts: Array | float, limit: float, error: Array | float) -> Array:
    """Return the probability that drifts keep a limit on their size.

    Args:
        drifts: the drifts as they are predicted.
        limit: largest size allowed.
        error: standard deviation of the predictions' normal error.
    """
    above, below = stats.norm.cdf((limit - drifts) / error), stats.norm.cdf((-limit - drifts) / error)
    return np.asarray(above - below, dtype=float)


def chances(
    walked: Walked, weights: Array, points: Array, drifts: Filmed, limit: float, settings: BeliefSettings
) -> Array:
    """Return how probable it is that each gait keeps its limits, shape (gaits,).

    The drift of a gait is believed as its speed is: each robot predicts it, and what films measure beyond
    that is a Gaussian process over the gait space. Of other limits the robots that keep them count.

    Args:
        walked: the gaits on the robots.
        weights: probability of each robot by the speeds that were measured, shape (robots,).
        points: points of the gaits, in a space of true distances, shape (gaits, d).
        drifts: sideways over forward travel in films, left positive.
        limit: largest drift allowed; infinite where there is no limit on it.
        settings: see `BeliefSettings`.
    """
    kept = np.where(walked.strays, 0.0, 1.0)
    if not np.isfinite(limit):
        return np.asarray(weights @ kept, dtype=float)
    filmed = replace(drifts, speeds=bounded(drifts.speeds))
    belief = Belief.of(drifts_of(walked), points, filmed, settings.drift, settings)
    spread = np.sqrt(np.maximum(np.diag(belief.unknown), 1e-12))
    both = weights * belief.weights
    both = both / both.sum() if both.sum() > 0.0 else weights
    return np.asarray(both @ (kept * within(belief.robots, limit, spread)), dtype=float)
