"""Which way a robot goes: by its joints, its symmetry, its feet and its length; words give the sign alone."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.robot.tree import robot_bodies, trunk

Array = NDArray[np.float64]

_AHEAD = ("end_effector", "front", "fore", "nose", "head", "eye", "face")
_BEHIND = ("rear", "back", "hind", "tail")

_SYMMETRIC = 0.03
"""Largest distance of mirrored geoms from their counterparts, as a share of the robot's size."""

_LONGER = 1.2
"""Sides in this ratio or above tell length from width."""


def up_axis(model: mujoco.MjModel) -> tuple[Array, str]:
    """Return the direction against gravity, and what it rests on."""
    size = float(np.linalg.norm(model.opt.gravity))
    if not size:
        return np.array([0.0, 0.0, 1.0]), "up: the world's z axis, as there is no gravity"
    return -np.array(model.opt.gravity) / size, ""


def forward_axis(
    model: mujoco.MjModel, data: mujoco.MjData, pads: Sequence[int], up: Array
) -> tuple[Array, str]:
    """Return the direction of travel, and what it rests on.

    Args:
        model: the robot.
        data: the robot as it is drawn.
        pads: geoms that grip.
        up: direction against gravity.
    """
    axes = [axis for axis in np.eye(3) if abs(axis @ up) < 0.5]
    slides = _slides(model, data, up)
    if len(slides) == 1:
        name, axis = slides[0]
        why = f"the one way that the joint {name!r} leaves it"
    else:
        axis, why = _by_shape(model, data, pads, axes)
    sign, word = _sign(model, data, axis)
    turned = " (turn it round if it walks backwards)" if not word else ""
    words = f"; {word}" if word else ""
    return sign * axis, f"forward: {why}{words}{turned}"


def _by_shape(
    model: mujoco.MjModel, data: mujoco.MjData, pads: Sequence[int], axes: Sequence[Array]
) -> tuple[Array, str]:
    """Return an axis of the world by symmetry, or else by the longer side of the feet or of the robot."""
    own = np.flatnonzero(robot_bodies(model)[model.geom_bodyid])
    places, sizes = data.geom_xpos[own], model.geom_size[own]
    mirrored = [_mirrors(places, sizes, axes[1 - i]) for i in range(2)]
    if mirrored[0] != mirrored[1]:
        index = 0 if mirrored[0] else 1
        return axes[index], f"the world's {_letter(axes[index])}, to whose two sides the robot is alike"
    for what, points in (("its feet", data.geom_xpos[list(pads)]), ("it", _corners(model, data, own))):
        sides = [float(np.ptp(points @ axis)) if len(points) else 0.0 for axis in axes]
        longer = int(np.argmax(sides))
        if sides[longer] > _LONGER * sides[1 - longer]:
            stand = "stand" if what == "its feet" else "is"
            return axes[longer], f"the world's {_letter(axes[longer])}, along which {what} {stand} longer"
    return axes[0], f"the world's {_letter(axes[0])}, as neither its shape nor its feet tell"


def _corners(model: mujoco.MjModel, data: mujoco.MjData, geoms: NDArray[np.intp]) -> Array:
    """Return points at the ends of each geom's bounding sphere along the world's axes, shape (n, 3)."""
    places, reach = data.geom_xpos[geoms], model.geom_rbound[geoms, None, None] * np.eye(3)
    ends: Array = np.concatenate([places[:, None] + reach, places[:, None] - reach]).reshape(-1, 3)
    return ends


def _mirrors(places: Array, sizes: Array, across: Array) -> bool:
    """Return whether geoms mirror each other in the plane through their middle across a direction."""
    side = places @ across
    middle = 0.5 * (side.min() + side.max())
    image = places - 2.0 * (side - middle)[:, None] * across
    extent = float(np.ptp(places, axis=0).max()) or 1.0
    for point, size in zip(image, sizes, strict=True):
        alike = np.abs(sizes - size).max(axis=1) < 1e-6 + 0.01 * size.max()
        if np.linalg.norm(places[alike] - point, axis=1).min(initial=np.inf) > _SYMMETRIC * extent:
            return False
    return True


def _slides(model: mujoco.MjModel, data: mujoco.MjData, up: Array) -> list[tuple[str, Array]]:
    """Return the names and axes of the slides by which the trunk moves in the world, if they are level."""
    found = []
    for joint in _trunk_joints(model):
        axis = np.array(data.xaxis[joint])
        if int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE) and abs(axis @ up) < 0.5:
            found.append((str(model.joint(joint).name), np.round(axis, 6) + 0.0))
    return found


def _trunk_joints(model: mujoco.MjModel) -> range:
    """Return the joints between the world and the trunk."""
    first = int(model.body_jntadr[trunk(model)])
    return range(first, first + int(model.body_jntnum[trunk(model)]))


def _sign(model: mujoco.MjModel, data: mujoco.MjData, axis: Array) -> tuple[float, str]:
    """Return which way along an axis the parts lie that are called after the front, and the word."""
    for words, sign in ((_AHEAD, 1.0), (_BEHIND, -1.0)):
        for word in words:
            ways = _ways(model, data, axis, word)
            if ways and abs(sum(ways)) > 0.5 * len(ways):
                return sign * float(np.sign(sum(ways))), f"the sign by what is called {word!r}"
    return 1.0, ""


def _ways(model: mujoco.MjModel, data: mujoco.MjData, axis: Array, word: str) -> list[float]:
    """Return on which side of the robot's middle each part lies whose name has a word: -1, 0 or 1."""
    own = robot_bodies(model)
    geoms = np.flatnonzero(own[model.geom_bodyid])
    along = data.geom_xpos[geoms] @ axis
    middle, reach = 0.5 * (along.min() + along.max()), 0.5 * float(np.ptp(along))
    places = [data.xpos[i] for i in np.flatnonzero(own) if word in model.body(i).name.lower()]
    places += [data.geom_xpos[i] for i in geoms if word in model.geom(i).name.lower()]
    sites = [i for i in range(model.nsite) if own[model.site_bodyid[i]]]
    places += [data.site_xpos[i] for i in sites if word in model.site(i).name.lower()]
    offsets = [float(place @ axis) - middle for place in places]
    return [float(np.sign(offset)) if abs(offset) > 0.1 * reach else 0.0 for offset in offsets]


def _letter(axis: Array) -> str:
    return "xyz"[int(np.argmax(np.abs(axis)))]
