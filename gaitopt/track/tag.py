"""One printed tag: its pattern and its corners."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from gaitopt.track.opencv import opencv

CELLS = 8
"""Cells along the edge of a tag's black square: 6 of the code, and the border."""

MARGIN = 1.0 / CELLS
"""White margin that a tag needs all around, as a share of its edge: one cell."""

Array = NDArray[np.float64]


@cache
def pattern(number: int) -> NDArray[np.bool_]:
    """Return which cells of a tag are black, the first row at the top, shape (8, 8)."""
    aruco = opencv().aruco
    family = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11)
    return np.asarray(aruco.generateImageMarker(family, number, CELLS)) < 128


def corners(size: float) -> Array:
    """Return the corners of a tag's black square, as a detector names them: from the top left, clockwise.

    Args:
        size: edge of the square, in any unit.

    Returns:
        In the tag's own frame (x in reading direction, y to the top, z out of its face), shape (4, 3).
    """
    half = 0.5 * size
    return np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
