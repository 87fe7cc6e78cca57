"""The camera of a film: it stands at the robot's right, so that forward is to the right, and follows it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.report.film.take import Take
from gaitopt.report.settings import FilmSettings

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
    across = math.atan(math.tan(half_view) * size[0] / size[1])
    wide, high = _extent(shown, path)
    wide = max(wide, min(_ghost_width(shown, path, times), settings.ghost_reach * wide))
    camera.distance = settings.margin * max(wide / (2 * math.tan(across)), high / (2 * math.tan(half_view)))
    return camera


def followed(shown: Take) -> NDArray[np.float64]:
    """Return where the camera looks: the robot's middle, m, averaged over a cycle, shape (n, 3)."""
    time = shown.trajectory.time
    every = max(1, len(time) // _POSES_FOLLOWED)
    sampled = time[::every]
    own = np.flatnonzero(shown.model.geom_bodyid > 0)
    corners = _corners_of(shown, shown.poses[::every], own)
    middles = np.array([0.5 * (each.min(axis=0) + each.max(axis=0)) for each in corners])
    step = float(np.median(np.diff(sampled))) if len(middles) > 1 else 1.0
    half = max(1, round(0.5 * shown.block_s / step))
    smooth = (_running_mean(series, half) for series in middles.T)
    return np.stack([np.interp(time, sampled, series) for series in smooth], axis=1)


def _extent(shown: Take, path: NDArray[np.float64]) -> tuple[float, float]:
    """Return how wide and how high a picture about `path` must be for the robot to stay in it, m."""
    forward, _, up = shown.axes
    wide = high = 0.0
    visible = np.flatnonzero((shown.model.geom_bodyid > 0) & (shown.model.geom_rgba[:, 3] > 0.0))
    every = max(1, len(path) // _POSES_FRAMED)
    for corners, seen in zip(_corners_of(shown, shown.poses[::every], visible), path[::every], strict=True):
        wide = max(wide, 2.0 * float(np.abs((corners - seen) @ forward).max()))
        high = max(high, 2.0 * float(np.abs((corners - seen) @ up).max()))
    return wide, high


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
    model, data = shown.model, mujoco.MjData(shown.model)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    centre, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
    local = centre[:, None] + signs * half[:, None]
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        turned = np.einsum("gij,gcj->gci", data.geom_xmat[geoms].reshape(-1, 3, 3), local)
        yield (data.geom_xpos[geoms, None] + turned).reshape(-1, 3)


def _running_mean(series: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    padded = np.pad(series, half, mode="edge")
    return np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
