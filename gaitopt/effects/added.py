"""Parts that effects add to a model: their names, and the parts that they belong to."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

_PREFIX = "gaitopt:"


def added_name(what: str, owner: str) -> str:
    """Return the name of a part that an effect adds to a model for the part `owner`."""
    return f"{_PREFIX}{what}:{owner}"


def is_added(name: str) -> bool:
    """Whether a part of a model was added by an effect."""
    return name.startswith(_PREFIX)


def owner_of(name: str) -> str:
    """Return the part of the nominal model that an added part belongs to."""
    return name.removeprefix(_PREFIX).partition(":")[2]


def control_columns(model: mujoco.MjModel, channels: Sequence[str]) -> list[int]:
    """Return the channel whose command each actuator gets; an added actuator gets its owner's."""
    names = [model.actuator(i).name for i in range(model.nu)]
    return [channels.index(owner_of(name) if is_added(name) else name) for name in names]


def transferred(
    qpos: NDArray[np.float64], nominal: mujoco.MjModel, model: mujoco.MjModel
) -> NDArray[np.float64]:
    """Return a nominal robot's pose for a model that has the same joints in the same order, and added ones.

    Each joint keeps its distance from its reference; an added joint has its owner's angle.
    """
    pose = np.array(model.qpos0)
    own = [j for j in range(model.njnt) if not is_added(model.joint(j).name)]
    for before, joint in enumerate(own):
        old, new = nominal.joint(before).qpos0, int(model.jnt_qposadr[joint])
        start = int(nominal.jnt_qposadr[before])
        pose[new : new + len(old)] += qpos[start : start + len(old)] - old
    return with_added(pose, model)


def with_added(pose: NDArray[np.float64], model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return joint angles, shape (nq,), in which each added joint has its owner's angle."""
    pose = np.array(pose)
    for joint in range(model.njnt):
        name = model.joint(joint).name
        if is_added(name):
            pose[model.jnt_qposadr[joint]] = pose[model.joint(owner_of(name)).qposadr[0]]
    return pose
