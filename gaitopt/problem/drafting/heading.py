"""Which way a robot goes: by its joints, its symmetry, its feet and its length; words give the sign alone."""

from __future__ import annotations

import re
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.robot.boxes import box_corners
from gaitopt.robot.tree import robot_bodies, trunk

Array = NDArray[np.float64]

_AHEAD = ("end_effector", "front", "fore", "nose", "head", "eye", "face")
_BEHIND = ("rear", "back", "hind", "tail")

_FRONT_LEGS = ("fl", "fr", "lf", "rf")
_HIND_LEGS = ("bl", "br", "rl", "rr", "hl", "hr", "lh", "rh", "lb", "rb")
"""How legs are called after front, back, rear or hind, left and right."""

_SYMMETRIC = 0.03
"""Largest distance of mirrored geoms from their counterparts, as a share of the robot's size."""

_LIMBS = 4
"""Robots with fewer limbs have no two sides by their limbs alone."""

_CLEAR = 0.1
"""A foot closer to the middle is on neither side, as a share of how far the outermost is."""

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
    feet = data.geom_xpos[list(pads)]
    sided = [_on_two_sides(feet @ axes[1 - i]) for i in range(2)]
    if sided[0] != sided[1]:
        index = 0 if sided[0] else 1
        return axes[index], f"the world's {_letter(axes[index])}, on whose two sides it has as many feet"
    hips = data.xpos[_hips(model, pads)]
    for what, points in (
        ("its limbs hang", hips),
        ("its feet stand", feet),
        ("its trunk is", box_corners(data, own[model.geom_bodyid[own] == trunk(model)])),
        ("it is", box_corners(data, own)),
    ):
        sides = [float(np.ptp(points @ axis)) if len(points) else 0.0 for axis in axes]
        longer = int(np.argmax(sides))
        if sides[longer] > _LONGER * sides[1 - longer]:
            return axes[longer], f"the world's {_letter(axes[longer])}, along which {what} longer"
    called = [axis for axis in axes if _sign(model, data, axis)[1]]
    if len(called) == 1:
        return called[0], f"the world's {_letter(called[0])}, as parts are called after front and rear"
    return axes[0], f"the world's {_letter(axes[0])}, as neither its shape nor its feet tell"


def _on_two_sides(offsets: Array) -> bool:
    """Return whether half of the feet, four or more, stand clearly on one side and half on the other."""
    if len(offsets) < _LIMBS:
        return False
    middle, reach = 0.5 * (offsets.min() + offsets.max()), 0.5 * float(np.ptp(offsets))
    clear = np.sign(np.where(np.abs(offsets - middle) > _CLEAR * reach, offsets - middle, 0.0))
    return bool(clear.all()) and float(clear.sum()) == 0.0


def _hips(model: mujoco.MjModel, pads: Sequence[int]) -> list[int]:
    """Return the bodies next to the trunk that carry feet; none of a robot with few."""
    found, base = set(), trunk(model)
    for body in model.geom_bodyid[list(pads)].tolist():
        while int(model.body_parentid[body]) not in (0, base):
            body = int(model.body_parentid[body])
        found |= {body} - {base}
    return sorted(found) if len(found) >= _LIMBS else []


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
    for words, sign in ((_AHEAD, 1.0), (_BEHIND, -1.0), (_FRONT_LEGS, 1.0), (_HIND_LEGS, -1.0)):
        for word in words:
            ways = _ways(model, data, axis, word, words in (_FRONT_LEGS, _HIND_LEGS))
            if ways and abs(sum(ways)) > 0.5 * len(ways):
                return sign * float(np.sign(sum(ways))), f"the sign by what is called {word!r}"
    return 1.0, ""


def _ways(model: mujoco.MjModel, data: mujoco.MjData, axis: Array, word: str, whole: bool) -> list[float]:
    """Return on which side of the robot's middle each part lies whose name has a word: -1, 0 or 1.

    Args:
        model, data: the robot.
        axis: the way along which sides are told.
        word: the word.
        whole: whether it is an abbreviation, which counts between other signs than letters only.
    """
    holds = re.compile(rf"(?<![a-z]){word}(?![a-z])" if whole else word).search
    own = robot_bodies(model)
    geoms = np.flatnonzero(own[model.geom_bodyid])
    along = data.geom_xpos[geoms] @ axis
    middle, reach = 0.5 * (along.min() + along.max()), 0.5 * float(np.ptp(along))
    places = [data.xpos[i] for i in np.flatnonzero(own) if holds(model.body(i).name.lower())]
    places += [data.geom_xpos[i] for i in geoms if holds(model.geom(i).name.lower())]
    sites = [i for i in range(model.nsite) if own[model.site_bodyid[i]]]
    places += [data.site_xpos[i] for i in sites if holds(model.site(i).name.lower())]
    offsets = [float(place @ axis) - middle for place in places]
    return [float(np.sign(offset)) if abs(offset) > 0.1 * reach else 0.0 for offset in offsets]


def _letter(axis: Array) -> str:
    return "xyz"[int(np.argmax(np.abs(axis)))]
