"""MuJoCo's own rules of contact: which geoms can touch, and which friction a contact of two geoms has."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.robot.tree import surroundings


def can_touch(model: mujoco.MjModel, one: int, other: int) -> bool:
    """Return whether two geoms collide by their ``contype`` and ``conaffinity``."""
    types, affinities = model.geom_contype, model.geom_conaffinity
    return bool(types[one] & affinities[other] or types[other] & affinities[one])


def can_touch_ground(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom collides with any geom around the robot."""
    return any(can_touch(model, geom, other) for other in surroundings(model))


def mixed_friction(model: mujoco.MjModel, one: int, other: int) -> NDArray[np.float64]:
    """Return the friction of a contact of two geoms.

    MuJoCo takes the coefficients of the geom of higher ``priority``, or the larger of each where the
    priorities are equal.

    Returns:
        Coefficients of sliding, torsional (m) and rolling (m) friction, shape (3,).
    """
    priorities = model.geom_priority[[one, other]]
    if priorities[0] != priorities[1]:
        return np.array(model.geom_friction[(one, other)[priorities.argmax()]])
    return np.array(model.geom_friction[[one, other]].max(axis=0))
