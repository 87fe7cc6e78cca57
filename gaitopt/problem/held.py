"""A robot that is held in the hand, or screwed to a bench: it stays where it starts, and touches nothing."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco

from gaitopt.core.errors import GaitoptError

_POSE, _TWIST = 7, 6
"""Numbers of a free joint in a pose and in a velocity."""

_TURNS = ("euler", "axisangle", "xyaxes", "zaxis", "quat")
"""Attributes that turn a body."""


def hold(root: ET.Element, model: mujoco.MjModel, start: str, source: Path) -> None:
    """Take the free joints and all contacts out of an MJCF, in place.

    A body without its free joint stays where the keyframe puts it, if there is one, or else where the MJCF
    does.

    Args:
        root: the MJCF, its includes resolved.
        model: the same, compiled.
        start: name of the keyframe.
        source: the MJCF, for messages.

    Raises:
        GaitoptError: a free joint cannot be found in the text.
    """
    free = [i for i in range(model.njnt) if int(model.jnt_type[i]) == int(mujoco.mjtJoint.mjJNT_FREE)]
    bodies = list(_freed(root))
    if len(bodies) != len(free):
        raise GaitoptError(f"{source}: the robot cannot be held: a free joint has its type from a default")
    keys = [model.key(i).name for i in range(model.nkey)]
    for body, joint, index in bodies:
        place = int(model.jnt_qposadr[free[index]])
        if start in keys and body in root.findall("worldbody/body"):
            _put(body, model.key(start).qpos[place : place + _POSE].tolist())
        body.remove(joint)
    for key in root.findall("keyframe/key"):
        _cut(key, "qpos", [int(model.jnt_qposadr[i]) for i in free], _POSE)
        _cut(key, "qvel", [int(model.jnt_dofadr[i]) for i in free], _TWIST)
    options = root.findall("option")
    option = options[0] if options else ET.SubElement(root, "option")
    for flag in root.findall("option/flag"):
        flag.attrib.pop("contact", None)
    found = option.find("flag")
    (ET.SubElement(option, "flag") if found is None else found).set("contact", "disable")


def _freed(root: ET.Element) -> Iterator[tuple[ET.Element, ET.Element, int]]:
    """Yield each body that has a free joint, with the joint and its number."""
    found = 0
    for body in list(root.findall("worldbody//body")):
        for joint in list(body):
            if joint.tag == "freejoint" or (joint.tag == "joint" and joint.get("type") == "free"):
                yield body, joint, found
                found += 1


def _put(body: ET.Element, pose: Sequence[float]) -> None:
    """Place a body by its position, m, and its quaternion."""
    for key in _TURNS:
        body.attrib.pop(key, None)
    body.set("pos", " ".join(map(repr, pose[:3])))
    body.set("quat", " ".join(map(repr, pose[3:])))


def _cut(key: ET.Element, name: str, places: Sequence[int], width: int) -> None:
    """Take the numbers of free joints out of a keyframe."""
    numbers = key.get(name, "").split()
    kept = [n for i, n in enumerate(numbers) if not any(p <= i < p + width for p in places)]
    if numbers:
        key.set(name, " ".join(kept))
