"""Servos that lose their power: NaN among the commands that arrive."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import is_added

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_GROUPS = 31
"""Groups of actuators that MuJoCo can disable."""


def held_while_unpowered(ctrl: Array, before: Array) -> tuple[Array, Array, Flags | None]:
    """Return commands without NaN, and where there was NaN: the servo is unpowered, and its input stays.

    Args:
        ctrl: what arrives at each actuator, rad, shape (n, nu).
        before: what it holds before the first row, rad, shape (nu,).

    Returns:
        The commands, what is held before them, and which actuators are unpowered in each row, shape (n, nu);
        None where all have power. A servo that has never had power holds its first command, or else 0.
    """
    off: Flags = np.isnan(ctrl)
    first = ctrl[np.argmin(off, axis=0), np.arange(ctrl.shape[1])]
    before = np.nan_to_num(np.where(np.isnan(before), first, before))
    if not off.any():
        return ctrl, before, None
    rows = np.concatenate([before[None], ctrl])
    last = np.where(np.isnan(rows), 0, np.arange(len(rows))[:, None])
    held: Array = np.take_along_axis(rows, np.maximum.accumulate(last, axis=0), axis=0)[1:]
    return held, before, off


def changes_of_power(off: Flags | None) -> list[int]:
    """Return the rows in which another set of actuators has power than in the row before."""
    if off is None:
        return []
    return [int(row) + 1 for row in np.flatnonzero((off[1:] != off[:-1]).any(axis=1))]


def without_others(model: mujoco.MjModel, off: Flags) -> Flags:
    """Return which actuators are unpowered, shape (n, nu), without added ones that are no part of a servo.

    Such a one, a cable that pulls at a body, turns no joint.
    """
    joint = int(mujoco.mjtTrn.mjTRN_JOINT)
    others = [
        i
        for i in range(model.nu)
        if is_added(model.actuator(i).name) and int(model.actuator_trntype[i]) != joint
    ]
    servos = off.copy()
    servos[:, others] = False
    return servos


def switch(model: mujoco.MjModel, off: Flags, groups: NDArray[np.int32]) -> None:
    """Cut the power of some actuators of a model, and restore that of the others.

    A disabled actuator gives no torque, and its activation, the state of its lag, stays.

    Args:
        model: the model that runs.
        off: actuators without power, shape (nu,).
        groups: group of each actuator with power, shape (nu,).
    """
    spare = max(set(range(_GROUPS)) - set(groups.tolist()))
    model.actuator_group[:] = np.where(off, spare, groups)
    model.opt.disableactuator |= 1 << spare
