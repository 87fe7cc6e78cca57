"""A lens: from pixels to directions and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 12
"""Rounds in which the distortion is undone."""


@dataclass(frozen=True)
class Lens:
    """A lens with radial distortion, as OpenCV has it; its axis goes through the middle of the picture.

    Attributes:
        size: width and height of the picture, pixels.
        focal: focal length, pixels.
        k1, k2: radial distortion.
        focal_sd: standard deviation of the focal length, pixels.
    """

    size: tuple[int, int]
    focal: float
    k1: float = 0.0
    k2: float = 0.0
    focal_sd: float = 0.0

    @property
    def middle(self) -> Array:
        """Middle of the picture, pixels, shape (2,); the middle of the first pixel is 0."""
        return 0.5 * (np.array(self.size, dtype=float) - 1.0)

    def pixels(self, points: Array) -> Array:
        """Return where points are seen.

        Args:
            points: in the camera's frame (x right, y down, z ahead), shape (..., 3).

        Returns:
            Pixels, shape (..., 2).
        """
        flat = points[..., :2] / points[..., 2:]
        square = np.sum(flat**2, axis=-1, keepdims=True)
        return np.asarray(self.focal * flat * (1.0 + square * (self.k1 + self.k2 * square)) + self.middle)

    def directions(self, pixels: Array) -> Array:
        """Return the directions in which pixels look: x and y at distance 1 ahead, shape (..., 2)."""
        bent = (pixels - self.middle) / self.focal
        flat = bent
        for _ in range(_ROUNDS):
            square = np.sum(flat**2, axis=-1, keepdims=True)
            flat = bent / (1.0 + square * (self.k1 + self.k2 * square))
        return np.asarray(flat)
