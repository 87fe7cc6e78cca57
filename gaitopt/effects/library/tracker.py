"""Mistakes of a tracker."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect
from gaitopt.effects.library.camera import moved_marker
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.robot.trajectory import Trajectory

_JUMP = (0.2, 1.0)
"""Shortest and longest jump of an outlier, in spans of the marker's path."""


def _jump(trajectory: Trajectory, share: float, parts: Parts, rng: np.random.Generator) -> Trajectory:
    """Move a share of the samples, each independently, by a random distance in the plane of the picture."""
    count = len(trajectory.time)
    hit = rng.random(count) < share
    angle = rng.uniform(0.0, 2.0 * math.pi, count)
    forward, _, up = parts.axes
    direction = np.cos(angle)[:, None] * forward + np.sin(angle)[:, None] * up
    size = rng.uniform(*_JUMP, count)[:, None]

    def jumped(path: NDArray[np.float64]) -> NDArray[np.float64]:
        span = float(np.linalg.norm(np.ptp(path, axis=0))) if count else 0.0
        moved: NDArray[np.float64] = path + hit[:, None] * (span * size * direction)
        return moved

    return moved_marker(trajectory, jumped)


MARKER_OUTLIERS = Effect(
    name="marker_outliers",
    summary="share of samples that jumped elsewhere",
    parameter="share",
    unit="",
    neutral=0.0,
    low=0.0,
    high=0.3,
    scale="lin",
    prior=Prior("half-normal", 0.0, 0.02, "automatic trackers lose a marker for a few frames in a hundred"),
    allowed=(0.0, 1.0),
    found_in_record=True,
    role="marker",
    observe=_jump,
)
