"""MuJoCo's own rules of contact: which geoms can touch, and which friction a contact of two geoms has."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True)
class Contact:
    """The parameters of a contact of two geoms.

    Attributes:
        condim: dimensions of the contact force.
        friction: coefficients of sliding, torsional (m) and rolling (m) friction, shape (3,).
        solref, solimp: compliance of the contact, shapes (2,) and (5,).
    """

    condim: int
    friction: NDArray[np.float64]
    solref: NDArray[np.float64]
    solimp: NDArray[np.float64]


def mixed_contact(model: mujoco.MjModel, one: int, other: int) -> Contact:
    """Return the parameters of a contact of two geoms by MuJoCo's rules: priority, else maximum and mean."""
    geoms = [one, other]
    priority = model.geom_priority[geoms]
    weights = model.geom_solmix[geoms] / max(float(model.geom_solmix[geoms].sum()), 1e-15)
    condim = model.geom_condim[geoms].max()
    if priority[0] != priority[1]:
        weights = (priority == priority.max()).astype(float)
        condim = model.geom_condim[geoms[int(priority.argmax())]]
    solref = model.geom_solref[geoms]
    direct = weights.max() < 1.0 and bool((solref[:, 0] <= 0.0).any())
    return Contact(
        condim=int(condim),
        friction=mixed_friction(model, one, other),
        solref=solref.min(axis=0) if direct else weights @ solref,
        solimp=weights @ model.geom_solimp[geoms],
    )


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
