"""Rotations: from quaternions to matrices, and to angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotation_matrices(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Return the rotation matrices of unit quaternions, each part of shape (n,): shape (n, 3, 3)."""
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(matrix), -1, 0)


def roll_pitch_yaw(turns: Array) -> Array:
    """Return the angles of rotations, shape (n, 3, 3): first about x, then y, then z; rad, shape (3, n).

    The second lies between -pi/2 and pi/2, the others between -pi and pi.
    """
    roll = np.arctan2(turns[:, 2, 1], turns[:, 2, 2])
    pitch = -np.arcsin(np.clip(turns[:, 2, 0], -1.0, 1.0))
    yaw = np.arctan2(turns[:, 1, 0], turns[:, 0, 0])
    return np.stack([roll, pitch, yaw])


def matrices_of_angles(roll: Array, pitch: Array, yaw: Array) -> Array:
    """Return the rotations with angles as `roll_pitch_yaw` gives them, rad, each of shape (n,): (n, 3, 3)."""
    (a, b, c), (p, q, r) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    matrix = [
        [b * c, p * q * c - a * r, a * q * c + p * r],
        [b * r, p * q * r + a * c, a * q * r - p * c],
        [-q, p * b, a * b],
    ]
    return np.moveaxis(np.array(matrix), -1, 0)
