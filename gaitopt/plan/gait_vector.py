"""Gait vectors: a two-module crawler's gait as sixteen numbers, which the planar model plans with.

A vector is ``[period, (duty, phase, amplitude, offset, smoothing) x 3]``, in s, cycles and rad, of the
middle channel, the rear foot and the front foot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

N_GAIT = 16
"""Numbers of a gait vector."""

CHANNEL_STARTS = (1, 6, 11)
"""Where the middle, the rear foot's and the front foot's five numbers begin in a gait vector."""


@dataclass(frozen=True)
class GaitBounds:
    """Box of gait vectors, and the range of each servo's targets."""

    lower: Vector  # (16,)
    upper: Vector  # (16,)
    angle_lower: Vector  # (3,) rad
    angle_upper: Vector  # (3,) rad


def to_ramps(gait: Vector) -> Vector:
    """Return the gait vector with each channel's smoothing replaced by its ramp in cycles."""
    gait = np.array(gait, dtype=float)
    for c in CHANNEL_STARTS:
        gait[c + 4] *= min(gait[c], 1 - gait[c])
    return gait


def to_smoothing(ramped: Vector) -> Vector:
    """Return the gait vector of a ramped one: the inverse of `to_ramps`."""
    gait = np.array(ramped, dtype=float)
    for c in CHANNEL_STARTS:
        gait[c + 4] = min(1.0, gait[c + 4] / min(gait[c], 1 - gait[c]))
    return gait


def gait_distance(a: Vector, b: Vector) -> float:
    """Return the root mean square difference of two gait vectors over natural scales.

    Period by its logarithm, phases in cycles relative to the middle channel (circular), angles
    by 90 degrees.
    """
    parts = [math.log(a[0] / b[0])]
    for c in CHANNEL_STARTS:
        turn = (a[c + 1] - a[2]) - (b[c + 1] - b[2])
        parts += [a[c] - b[c], turn - round(turn)]
        parts += [(a[c + 2] - b[c + 2]) * 2 / math.pi, (a[c + 3] - b[c + 3]) * 2 / math.pi]
    return float(np.sqrt(np.mean(np.square(parts))))


def random_gait(bounds: GaitBounds, rng: np.random.Generator) -> Vector:
    """Return a gait vector within bounds: period log-uniform, commanded angles in range."""
    gait = rng.uniform(bounds.lower, bounds.upper)
    assert gait.shape == (N_GAIT,)
    gait[0] = math.exp(rng.uniform(*np.log([bounds.lower[0], bounds.upper[0]])))
    for i, c in enumerate(CHANNEL_STARTS):
        low, high = bounds.angle_lower[i], bounds.angle_upper[i]
        ends = np.sort(rng.uniform(low, high, 2))
        at_rest, moved = ends if bounds.upper[c + 2] > 0 else ends[::-1]
        gait[c + 2], gait[c + 3] = moved - at_rest, at_rest
    return gait
