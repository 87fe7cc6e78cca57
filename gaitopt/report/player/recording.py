"""The motion of a robot as a page plays it: where its bodies are and what touches, at a fixed rate."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.report.film.take import Take
from gaitopt.report.player.shapes import Shapes

Array = NDArray[np.float64]

BYTES_PER_BODY = 14
"""Of a body at one moment: three coordinates and four parts of a quaternion, two bytes each."""


@dataclass(frozen=True)
class Recording:
    """Where a robot's bodies are.

    Attributes:
        time: gait time of each moment, s, shape (n,).
        positions: where the bodies are in the world, m, shape (n, bodies, 3).
        turns: how they are turned, quaternions (w, x, y, z) without jumps of the sign, shape (n, bodies, 4).
        touching: whether each shape touches what is not its own body, shape (n, shapes).
        marker: where the marker is, m, shape (n, 3); None without one.
    """

    time: Array
    positions: Array
    turns: Array
    touching: NDArray[np.bool_]
    marker: Array | None


def record(shown: Take, shapes: Shapes, rate_hz: float, seconds: float) -> Recording:
    """Return what is played of a motion: each one of its samples, at even distances.

    Args:
        shown: the motion, with poses.
        shapes: what is drawn of it.
        rate_hz: moments per second, about.
        seconds: longest time that is kept.
    """
    clock = shown.trajectory.time
    step = float(clock[-1] - clock[0]) / max(1, len(clock) - 1)
    every = max(1, round(1.0 / (rate_hz * step))) if step > 0.0 else 1
    rows = np.arange(0, len(clock), every)
    rows = rows[clock[rows] <= clock[0] + seconds]
    model, data = shown.model, mujoco.MjData(shown.model)
    bodies = list(shapes.bodies)
    positions, turns = np.empty((len(rows), len(bodies), 3)), np.empty((len(rows), len(bodies), 4))
    touching = np.zeros((len(rows), len(shapes.geoms)), dtype=bool)
    for index, row in enumerate(rows):
        data.qpos[:] = shown.poses[row]
        for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_collision):
            step(model, data)
        positions[index], turns[index] = data.xpos[bodies], data.xquat[bodies]
        touching[index] = _touching(model, data, shapes)
    marker = shown.trajectory.stacked("marker")
    return Recording(
        clock[rows],
        positions,
        _without_jumps(turns),
        touching,
        marker[rows] if marker.shape[1] == 3 else None,
    )


def _touching(model: mujoco.MjModel, data: mujoco.MjData, shapes: Shapes) -> NDArray[np.bool_]:
    """Return which shapes touch something; those of a body do where a hidden geom of it does."""
    pairs = data.contact.geom[data.contact.dist <= 0.0]
    geoms = {int(geom) for geom in pairs.ravel() if model.body_weldid[model.geom_bodyid[geom]] != 0}
    hidden = {int(model.geom_bodyid[geom]) for geom in geoms - set(shapes.geoms)}
    return np.array([geom in geoms or int(model.geom_bodyid[geom]) in hidden for geom in shapes.geoms])


def _without_jumps(turns: Array) -> Array:
    """Return quaternions of which each is on the side of the one before: they can be interpolated."""
    products = np.sum(turns[1:] * turns[:-1], axis=-1)
    signs = np.cumprod(np.where(products < 0.0, -1.0, 1.0), axis=0)
    continued = turns.copy()
    continued[1:] *= signs[..., None]
    return continued
