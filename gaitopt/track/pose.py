"""Poses: a body's turn and shift from the corners of its tags, by Gauss and Newton."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.track.opencv import opencv

Array = NDArray[np.float64]

_ROUNDS, _STEP = 15, 1e-8
"""Most rounds of a fit, and the step after which it ends."""


@dataclass(frozen=True)
class Pose:
    """Where a body is.

    Attributes:
        turn: the body's axes as columns, shape (3, 3).
        shift: its origin, m, shape (3,).
        error: sum of the squared errors of directions.
        spread: covariance of turn, rad, and shift, m, for errors of 1 in each direction, shape (6, 6).
    """

    turn: Array
    shift: Array
    error: float = 0.0
    spread: Array | None = None

    def of(self, points: Array) -> Array:
        """Return points of the body in the outer frame, shape (..., 3)."""
        return points @ self.turn.T + self.shift

    def seen_from(self, camera: Pose) -> Pose:
        """Return a pose of the outer frame in a camera's frame; its spread does not change."""
        return Pose(camera.turn @ self.turn, camera.turn @ self.shift + camera.shift, self.error, self.spread)

    def back(self, camera: Pose) -> Pose:
        """Return a pose in a camera's frame as one in the outer frame, with its spread turned."""
        spread = self.spread
        if spread is not None:
            turn = np.kron(np.eye(2), camera.turn.T)
            spread = turn @ spread @ turn.T
        return Pose(
            camera.turn.T @ self.turn, camera.turn.T @ (self.shift - camera.shift), self.error, spread
        )


def fitted(points: Array, directions: Array, start: Pose) -> Pose | None:
    """Return the pose of points in a camera's frame that fits directions best; None if there is none near.

    Args:
        points: in the body's frame, m, shape (n, 3).
        directions: where each was seen, at distance 1 ahead, shape (n, 2).
        start: the pose to begin with.
    """
    turn, shift, damping = start.turn, start.shift, 1e-6
    error, slopes, residual = _linear(points, directions, turn, shift)
    for _ in range(_ROUNDS):
        normal = slopes.T @ slopes
        step = -np.linalg.solve(
            normal + damping * np.diag(np.diag(normal)) + 1e-15 * np.eye(6), slopes.T @ residual
        )
        moved = Rotation.from_rotvec(step[:3]).as_matrix() @ turn
        tried = _linear(points, directions, moved, shift + step[3:])
        if tried[0] <= error:
            turn, shift, damping = moved, shift + step[3:], 0.1 * damping
            gain = error - tried[0]
            error, slopes, residual = tried
            if float(np.abs(step).max()) < _STEP or gain < 1e-12 * error:
                break
        else:
            damping *= 100.0
            if damping > 1e6:
                break
    if not np.isfinite(error) or not (shift[2] > 0.0):
        return None
    return Pose(turn, shift, error, np.asarray(np.linalg.pinv(slopes.T @ slopes), dtype=float))


def follows(points: Array, pose: Pose, camera: Pose) -> Array:
    """Return how a fitted pose turns and shifts with errors of the directions, shape (6, 2 n).

    Args:
        points: in the body's frame, m, shape (n, 3).
        pose: the pose that fits, in the outer frame.
        camera: the outer frame's pose in the camera's.
    """
    seen = pose.seen_from(camera)
    slopes = _linear(points, np.zeros((len(points), 2)), seen.turn, seen.shift)[1]
    slopes = slopes @ np.kron(np.eye(2), camera.turn)
    return np.asarray(np.linalg.pinv(slopes))


def _linear(points: Array, directions: Array, turn: Array, shift: Array) -> tuple[float, Array, Array]:
    """Return the squared error, the slopes over turn and shift, shape (2 n, 6), and the residual, (2 n,)."""
    turned = points @ turn.T
    x, y, z = (turned + shift).T
    if not (z > 1e-6).all():
        return np.inf, np.zeros((2 * len(points), 6)), np.zeros(2 * len(points))
    along, up = x / z, y / z
    a, b, c = turned.T
    slopes = np.zeros((len(points), 2, 6))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 0, 2] = -along * b / z, (c + along * a) / z, -b / z
    slopes[:, 1, 0], slopes[:, 1, 1], slopes[:, 1, 2] = -(c + up * b) / z, up * a / z, a / z
    slopes[:, 0, 3] = slopes[:, 1, 4] = 1.0 / z
    slopes[:, 0, 5], slopes[:, 1, 5] = -along / z, -up / z
    residual = (np.column_stack([along, up]) - directions).ravel()
    return float(residual @ residual), slopes.reshape(-1, 6), residual


def poses_of(points: Array, directions: Array, starts: Iterable[Pose] = ()) -> list[Pose]:
    """Return the poses of flat points that fit directions, the best first: a flat thing often has two.

    Args:
        points: in the body's frame, m, shape (n, 3).
        directions: where each was seen, at distance 1 ahead, shape (n, 2).
        starts: poses to begin with, such as both of the picture before.
    """
    begins = list(starts)
    if len(begins) < 2:
        begins += _flat_starts(points, directions)
    found: list[Pose] = []
    for start in begins:
        pose = fitted(points, directions, start)
        if pose is not None and not any(_alike(pose, other) for other in found):
            found.append(pose)
    return sorted(found, key=lambda pose: pose.error)


def _alike(one: Pose, other: Pose) -> bool:
    return float(np.abs(one.turn - other.turn).max()) < 1e-3


def cross(a: Array) -> Array:
    """Return the matrix that multiplies by a vector, shape (3,), as the cross product does, shape (3, 3)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def turn_vector(turn: Array) -> Array:
    """Return the vector of a turn, shape (3, 3): along its axis, as long as its angle, rad, shape (3,).

    That is what SciPy's `Rotation` says, in a tenth of the time.
    """
    axis = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine, cosine = math.sqrt(float(axis @ axis)), 0.5 * (float(np.trace(turn)) - 1.0)
    if cosine < -0.9:  # half a turn: this says nothing of its axis
        return np.asarray(Rotation.from_matrix(turn).as_rotvec(), dtype=float)
    return axis * (math.atan2(sine, cosine) / sine) if sine > 0.0 else axis


def _flat_starts(points: Array, directions: Array) -> list[Pose]:
    """Return two first guesses: the pose of a plane, and its mirror image about the line of sight."""
    cv2 = opencv()
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre)[2]
    if np.linalg.det(axes) < 0.0:
        axes[2] *= -1.0
    flat = (points - centre) @ axes.T
    flat[:, 2] = 0.0
    solved = cv2.solvePnPGeneric(flat, directions, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    starts = []
    for turn, shift in zip(solved[1], solved[2], strict=True):
        whole = cv2.Rodrigues(turn)[0] @ axes
        starts.append(Pose(whole, shift.ravel() - whole @ centre))
    return starts
