"""The camera of a film: it stands at the robot's right, so that forward is to the right, and follows it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.report.film.take import Take
from gaitopt.report.settings import FilmSettings
from gaitopt.robot.boxes import box_corners
from gaitopt.robot.tree import robot_bodies

_POSES_FOLLOWED, _POSES_FRAMED = 400, 200
"""Poses of a rollout that are looked at, about: to follow the robot, and to keep it in the picture."""


def camera_of(
    shown: Take,
    path: NDArray[np.float64],
    times: NDArray[np.float64],
    size: tuple[int, int],
    settings: FilmSettings,
) -> mujoco.MjvCamera:
    """Return a camera from which the robot and its ghost stay in the picture.

    Args:
        shown: the robot.
        path: where the camera looks at each time of the trajectory, m, shape (n, 3).
        times: gait times of the pictures, s.
        size: width and height of a picture, pixels.
        settings: angles and margins.
    """
    _, left, _ = shown.axes
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE.value
    camera.azimuth = math.degrees(math.atan2(left[1], left[0])) + settings.side_deg
    camera.elevation = settings.elevation_deg
    half_view = math.radians(settings.field_of_view_deg) / 2.0
    slopes = np.tan([math.atan(math.tan(half_view) * size[0] / size[1]), half_view]) / settings.margin
    distance = _distance(shown, path, _axes(camera), slopes)
    ghost = 0.5 * _ghost_width(shown, path, times) / float(slopes[0])
    camera.distance = max(distance, min(ghost, settings.ghost_reach * distance))
    return camera


def followed(shown: Take) -> NDArray[np.float64]:
    """Return where the camera looks: the robot's middle, m, averaged over a cycle, shape (n, 3)."""
    time = shown.trajectory.time
    every = max(1, len(time) // _POSES_FOLLOWED)
    sampled = time[::every]
    own = np.flatnonzero(_geoms(shown))
    corners = _corners_of(shown, shown.poses[::every], own)
    middles = np.array([0.5 * (each.min(axis=0) + each.max(axis=0)) for each in corners])
    step = float(np.median(np.diff(sampled))) if len(middles) > 1 else 1.0
    half = max(1, round(0.5 * shown.block_s / step))
    smooth = (_running_mean(series, half) for series in middles.T)
    return np.stack([np.interp(time, sampled, series) for series in smooth], axis=1)


def _axes(camera: mujoco.MjvCamera) -> NDArray[np.float64]:
    """Return right, up and ahead of a camera in the world, shape (3, 3)."""
    turn, tip = math.radians(camera.azimuth), math.radians(camera.elevation)
    ahead = np.array([math.cos(tip) * math.cos(turn), math.cos(tip) * math.sin(turn), math.sin(tip)])
    right = np.array([math.sin(turn), -math.cos(turn), 0.0])
    return np.stack([right, np.cross(right, ahead), ahead])


def _distance(
    shown: Take, path: NDArray[np.float64], axes: NDArray[np.float64], slopes: NDArray[np.float64]
) -> float:
    """Return how far from `path` a camera must stay for the robot to be in the picture, near parts too, m.

    Args:
        shown: the robot.
        path: where the camera looks, m, shape (n, 3).
        axes: right, up and ahead of the camera.
        slopes: how far to the side, and up, it sees at a distance of 1.
    """
    visible = _geoms(shown) & (shown.model.geom_rgba[:, 3] > 0.0)
    every, distance = max(1, len(path) // _POSES_FRAMED), 0.0
    poses = _corners_of(shown, shown.poses[::every], np.flatnonzero(visible))
    for corners, seen in zip(poses, path[::every], strict=True):
        right, up, ahead = axes @ (corners - seen).T
        needed = np.maximum(np.abs(right) / slopes[0], np.abs(up) / slopes[1]) - ahead
        distance = max(distance, float(needed.max(initial=0.0)))
    return distance


def _geoms(shown: Take) -> NDArray[np.bool_]:
    """Return which geoms are the robot's, shape (ngeom,), or else all that are not the ground's."""
    own: NDArray[np.bool_] = robot_bodies(shown.model)[shown.model.geom_bodyid]
    return own if own.any() else shown.model.geom_bodyid > 0


def _ghost_width(shown: Take, path: NDArray[np.float64], times: NDArray[np.float64]) -> float:
    """Return how wide a picture about `path` must be for the ghost to stay in it, m; 0 without one."""
    ghost = shown.ghost
    if ghost is None:
        return 0.0
    during = (ghost.time >= times[0]) & (ghost.time <= times[-1])
    forward = shown.axes[0]
    seen = np.interp(ghost.time[during], shown.trajectory.time, path @ forward)
    return 2.0 * float(np.abs(ghost.positions[during] @ forward - seen).max(initial=0.0))


def _corners_of(
    shown: Take, poses: NDArray[np.float64], geoms: NDArray[np.intp]
) -> Iterator[NDArray[np.float64]]:
    """Yield the corners of the boxes around some geoms in the world at each pose, m, shape (8 n, 3)."""
    data = mujoco.MjData(shown.model)
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(shown.model, data)
        yield box_corners(data, geoms)


def _running_mean(series: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    padded = np.pad(series, half, mode="edge")
    return np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
