"""Boxes around geoms: their corners bound what a robot takes up."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CUBE: Array = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
"""Corners of a cube, shape (8, 3)."""


def box_corners(data: mujoco.MjData, geoms: NDArray[np.intp]) -> Array:
    """Return the corners of the boxes around some geoms in the world, m, shape (8 n, 3).

    Args:
        data: a pose; its kinematics are up to date.
        geoms: their ids, shape (n,).
    """
    model = data.model
    local = model.geom_aabb[geoms, None, :3] + CUBE * model.geom_aabb[geoms, None, 3:]
    turned = np.einsum("gij,gcj->gci", data.geom_xmat[geoms].reshape(-1, 3, 3), local)
    return np.asarray(data.geom_xpos[geoms, None] + turned).reshape(-1, 3)
