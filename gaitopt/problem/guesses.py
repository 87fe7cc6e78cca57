"""What can be read or guessed about a robot from its MJCF: roles, channels and parameters."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from gaitopt.robot.contact import can_touch_ground

_MARKER_WORDS = ("end_effector", "marker", "nose", "head", "tip", "front")
_PAD_WORDS = ("pad", "foot", "toe", "sole", "paw", "shoe")
_ASSUMED_RANGE_DEG = (-45.0, 45.0)
_DEFAULT_FRICTION = (0.005, 0.0001)
"""MuJoCo's default torsional and rolling friction, m."""

_QUOTES = {"'", '"'}

_LOWEST_SHARE = 0.1
"""Geoms within this share of the model's size above the lowest one count as lowest."""


@dataclass(frozen=True)
class GuessedRoles:
    """Roles as written to the problem file; see `Roles`.

    Attributes:
        marker, pads, body, hinges, forward, up: the roles.
        remarks: how they were guessed.
    """

    marker: str
    pads: Sequence[str]
    body: Sequence[str]
    hinges: Sequence[str]
    forward: Sequence[float]
    up: Sequence[float]
    remarks: Sequence[str]


@dataclass(frozen=True)
class GuessedChannel:
    """Bounds of one servo, degrees.

    Attributes:
        name: the actuator.
        range_deg: travel of the servo.
        amplitude_deg: amplitudes that a search may use.
        rest_deg: target before a gait.
        origin: where the range comes from.
    """

    name: str
    range_deg: tuple[float, float]
    amplitude_deg: tuple[float, float]
    rest_deg: float
    origin: str


@dataclass(frozen=True)
class GuessedParameter:
    """A number that all servos, or all pads, share: value, unit, and the TOML text of what it sets."""

    value: float
    unit: str
    sets: str


@dataclass(frozen=True)
class _Touching:
    """The named geoms that may touch the ground, by role."""

    pads: list[str]
    body: list[str]
    remarks: list[str]


def guess_roles(model: mujoco.MjModel, data: mujoco.MjData) -> GuessedRoles:
    """Return the roles of a robot.

    Args:
        model: the robot; it has a named site and gravity.
        data: the robot in its first pose, after `mj_forward`.
    """
    touching = _touching(model, data)
    forward, why = _forward(model, data)
    up = [round(float(g), 6) + 0.0 for g in -model.opt.gravity / np.linalg.norm(model.opt.gravity)]
    return GuessedRoles(
        _marker(model),
        touching.pads,
        touching.body,
        _passive_hinges(model),
        forward,
        up,
        [why, *touching.remarks],
    )


def guess_channel(model: mujoco.MjModel, actuator: int) -> GuessedChannel:
    """Return the bounds of a servo, from its own limits or from those of its joint."""
    joint = int(model.actuator_trnid[actuator, 0])
    on_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    if model.actuator_ctrllimited[actuator]:
        ends, origin = model.actuator_ctrlrange[actuator], "the actuator's ctrlrange"
    elif on_joint and model.jnt_limited[joint]:
        ends, origin = model.jnt_range[joint], "the joint's range"
    else:
        ends, origin = np.deg2rad(_ASSUMED_RANGE_DEG), "assumed: the MJCF limits neither servo nor joint"
    low, high = (round(float(end), 3) for end in np.rad2deg(ends))
    width = round(high - low, 3)
    amplitude = (-width, 0.0) if high <= 0.0 else (0.0, width)
    rest = min(max(0.0, low), high)
    return GuessedChannel(model.actuator(actuator).name, (low, high), amplitude, rest, origin)


def guess_parameters(
    model: mujoco.MjModel, root: ET.Element, pads: Sequence[str]
) -> dict[str, GuessedParameter]:
    """Return the numbers that all servos, or all pads, share, by name.

    Args:
        model: the robot.
        root: its MJCF, which has the numbers.
        pads: the pads.
    """
    found = {}
    alike = len(root.findall("actuator/position")) == model.nu
    gains = set(model.actuator_gainprm[:, 0].tolist())
    if alike and len(gains) == 1:
        found["k_servo"] = GuessedParameter(gains.pop(), "N m/rad", '["actuator/position/@kp"]')
    limits = {tuple(row) for row in model.actuator_forcerange.tolist()}
    if alike and model.actuator_forcelimited.all() and len(limits) == 1:
        low, high = limits.pop()
        if low == -high:
            sets = '{ "actuator/position/@forcerange" = "-{} {}" }'
            found["torque_limit"] = GuessedParameter(high, "N m", sets)
    frictions = {tuple(model.geom(name).friction.tolist()) for name in pads}
    if (
        not any(set(name) >= _QUOTES for name in pads)
        and len(frictions) == 1
        and next(iter(frictions))[1:] == _DEFAULT_FRICTION
    ):
        paths = ", ".join(json.dumps(_path_of(name), ensure_ascii=False) for name in pads)
        found["mu_pads"] = GuessedParameter(frictions.pop()[0], "1", f"[{paths}]")
    return found


def _path_of(geom: str) -> str:
    """Return the XPath of a geom's friction. XPath has no escape: the name lacks one of `_QUOTES`."""
    quote = '"' if "'" in geom else "'"
    return f".//geom[@name={quote}{geom}{quote}]/@friction"


def _marker(model: mujoco.MjModel) -> str:
    """Return the site whose name says that it is the marker, else the first site on a moving body."""
    named = [i for i in range(model.nsite) if model.site(i).name]
    moving = [i for i in named if model.site_bodyid[i] > 0] or named
    return str(model.site(min(moving, key=lambda i: (_rank(model.site(i).name), i))).name)


def _rank(name: str) -> int:
    """Return the place of the first marker's word in a name; the number of words where there is none."""
    words = enumerate(_MARKER_WORDS)
    return next((i for i, word in words if word in name.lower()), len(_MARKER_WORDS))


def _touching(model: mujoco.MjModel, data: mujoco.MjData) -> _Touching:
    """Return which named geoms are pads, which others may touch the ground, and how that was guessed."""
    own = [i for i in range(model.ngeom) if model.geom_bodyid[i] > 0 and can_touch_ground(model, i)]
    named = [i for i in own if model.geom(i).name]
    remarks = []
    if len(named) < len(own):
        remarks.append(f"{len(own) - len(named)} geoms that may touch the ground have no name: name them")
    pads = _geoms_by_word(model, named)
    if pads:
        remarks.append("pads: geoms called after pads or feet, or on bodies that are")
    else:
        pads = _lowest(model, data, named)
        remarks.append("pads: no geom is called after a foot or a pad; these are the lowest")
    names = [str(model.geom(i).name) for i in named]
    grip = {str(model.geom(i).name) for i in pads}
    return _Touching([n for n in names if n in grip], [n for n in names if n not in grip], remarks)


def _geoms_by_word(model: mujoco.MjModel, geoms: Sequence[int]) -> list[int]:
    """Return the geoms whose names, or else whose bodies' names, have the first pad's word that fits any."""
    own = {i: str(model.geom(i).name).lower() for i in geoms}
    bodies = {i: str(model.body(int(model.geom_bodyid[i])).name).lower() for i in geoms}
    for names in (own, bodies):
        for word in _PAD_WORDS:
            found = [i for i in geoms if word in names[i]]
            if found:
                return found
    return []


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int]) -> list[int]:
    """Return the lowest geoms."""
    height = [float(data.geom_xpos[i, 2] - model.geom_rbound[i]) for i in geoms]
    limit = min(height, default=0.0) + _LOWEST_SHARE * model.stat.extent
    return [i for i, h in zip(geoms, height, strict=True) if h <= limit]


def _passive_hinges(model: mujoco.MjModel) -> list[str]:
    driven = {int(model.actuator_trnid[i, 0]) for i in range(model.nu)}
    hinge, floating = int(mujoco.mjtJoint.mjJNT_HINGE), _floating_joints(model)
    found = [
        model.joint(i).name
        for i in range(model.njnt)
        if int(model.jnt_type[i]) == hinge and i not in driven and i not in floating
    ]
    return [str(name) for name in found if name]


def _floating_joints(model: mujoco.MjModel) -> set[int]:
    """Return the joints between the world and the first body; they are no hinges of the robot."""
    return {i for i in range(model.njnt) if model.body_parentid[model.jnt_bodyid[i]] == 0}


def _forward(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[float], str]:
    """Return the direction of travel, and how it was guessed."""
    for i in sorted(_floating_joints(model)):
        axis = np.abs(model.jnt_axis[i])
        if int(model.jnt_type[i]) == int(mujoco.mjtJoint.mjJNT_SLIDE) and axis[2] < 0.5:
            forward = [float(a) for a in np.round(model.jnt_axis[i], 6)]
            return forward, f"forward: the axis of the joint {model.joint(i).name!r}"
    own = np.flatnonzero(model.geom_bodyid > 0)
    sides = np.ptp(data.geom_xpos[own, :2], axis=0) if len(own) else np.array([1.0, 0.0])
    longer = [1.0, 0.0, 0.0] if sides[0] >= sides[1] else [0.0, 1.0, 0.0]
    return longer, "forward: the robot's longer side; turn it round if it walks backwards"
