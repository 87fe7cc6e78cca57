"""Dry friction of joints, as MuJoCo has it: a torque up to a limit that opposes motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

_SOLREF = (2e-3, 1.0)
_SOLIMP = (0.9999, 0.9999, 1e-3, 0.5, 2.0)
"""Dry friction that holds: with MuJoCo's default impedance a joint held by friction creeps.

With these it creeps by 1e-7 s times the acceleration that the friction holds back. A joint in motion stops
within two steps.
"""


def stiffen_friction(model: mujoco.MjModel, dofs: Sequence[int] | NDArray[np.integer]) -> None:
    """Let the dry friction of some degrees of freedom hold without visible creep."""
    model.dof_solref[dofs] = _SOLREF
    model.dof_solimp[dofs] = _SOLIMP


def varied_friction(model: mujoco.MjModel, dofs: Sequence[int]) -> Callable[[Sequence[float]], None]:
    """Return what sets one part of the dry friction of some degrees of freedom while a model runs, N m.

    Several effects may each set their own part: each replaces what it added before, and parts add up.
    """
    friction, added = model.dof_frictionloss, [0.0] * len(dofs)

    def set_part(torques: Sequence[float]) -> None:
        for index, torque in enumerate(torques):
            dof = dofs[index]
            friction[dof] = friction.item(dof) + (torque - added[index])
            added[index] = torque

    return set_part
