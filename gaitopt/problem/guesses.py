"""What can be read or guessed about a robot from its MJCF and its stance: roles, channels and parameters."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.calibration import Calibration
from gaitopt.problem.drafting.family import guess_pads, limbs_of
from gaitopt.problem.drafting.heading import forward_axis, up_axis
from gaitopt.problem.drafting.motors import ASSUMED_RANGE_RAD
from gaitopt.problem.drafting.names import unused
from gaitopt.problem.drafting.standing import Standing, joint_travel
from gaitopt.robot.contact import can_touch, mixed_friction
from gaitopt.robot.tree import driven_joints, every_driven_joint, robot_bodies, surroundings, trunk

_TRUNK_SITES = ("marker", "torso", "trunk", "body", "base", "com", "imu")
"""What sites in the middle of a trunk are called, the best first."""

_MARKERS = ("marker", "end_effector")
"""What a site elsewhere is called that is meant as marker."""

_QUOTES = {"'", '"'}

_KEY_BREAKS = re.compile(r"[^A-Za-z0-9_-]+")
"""What is not taken over from the name of a part into that of a parameter."""

USUAL_SERVO = Calibration()
"""The servo that is assumed on each channel."""

_LEGS = 3
"""A robot with fewer limbs is a chain of links, each of which goes where the robot goes."""

NEW_MARKER = "marker"
"""Site that is added to a trunk without any."""


@dataclass(frozen=True)
class GuessedRoles:
    """Roles as written to the problem file; see `Roles`.

    Attributes:
        marker, trunk, pads, body, hinges, forward, up: the roles.
        remarks: how they were guessed.
        pad_ids: geom ids of the pads.
    """

    marker: str
    trunk: str
    pads: Sequence[str]
    body: Sequence[str]
    hinges: Sequence[str]
    forward: Sequence[float]
    up: Sequence[float]
    remarks: Sequence[str]
    pad_ids: Sequence[int]


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

    @property
    def neutral_us(self) -> int:
        """Pulse at angle 0 if the middle of the range is the middle of the servo, or the nearest one, µs."""
        usual, (low, high) = USUAL_SERVO, self.range_deg
        middle = usual.neutral_us - usual.us_per_deg * (low + high) / 2
        return min(max(round(middle), usual.min_us), usual.max_us)


@dataclass(frozen=True)
class GuessedParameter:
    """A number that all servos, or all pads, share: value, unit, and the TOML text of what it sets."""

    value: float
    unit: str
    sets: str


def guess_roles(model: mujoco.MjModel, standing: Standing) -> GuessedRoles:
    """Return the roles of a robot.

    Args:
        model: the robot; its parts are named.
        standing: how it stands.
    """
    pads, why_pads = guess_pads(model, standing)
    up, why_up = up_axis(model)
    forward, why_forward = forward_axis(model, standing.drawn, pads, up)
    marker, why_marker = _marker(model, pads)
    base = trunk(model)
    others = [geom for geom in _touchable(model) if geom not in pads]
    return GuessedRoles(
        marker=marker,
        trunk=str(model.body(base).name),
        pads=[str(model.geom(i).name) for i in pads],
        body=[str(model.geom(i).name) for i in others if model.geom(i).name],
        hinges=_passive_hinges(model),
        forward=[round(float(x), 6) + 0.0 for x in forward],
        up=[round(float(x), 6) + 0.0 for x in up],
        remarks=[
            f"trunk: {model.body(base).name}, the root of the heaviest tree that the actuators move",
            why_forward,
            *filter(None, [why_up]),
            why_pads,
            why_marker,
        ],
        pad_ids=pads,
    )


def guess_channel(model: mujoco.MjModel, actuator: int, rest: float) -> GuessedChannel:
    """Return the bounds of a servo, from its own limits or from those of what it turns.

    Args:
        model: the robot.
        actuator: the servo.
        rest: its start target, rad.
    """
    travel = joint_travel(model, actuator)
    if model.actuator_ctrllimited[actuator]:
        ends, origin = model.actuator_ctrlrange[actuator].tolist(), "the actuator's ctrlrange"
    elif np.isfinite(travel).all():
        ends, origin = list(travel), "the joint's range"
    else:
        ends = [rest - ASSUMED_RANGE_RAD, rest + ASSUMED_RANGE_RAD]
        origin = "assumed: the MJCF limits neither servo nor joint"
    turned = driven_joints(model, actuator)
    if len(turned) > 1:
        origin += f"; the length of a tendon over {', '.join(model.joint(j).name for j in turned)}"
    elif any(int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_SLIDE) for j in turned):
        origin += "; a slide: one degree here is 0.01745 m"
    low, high = (round(float(end), 3) for end in np.rad2deg(ends))
    width = math.floor(1e3 * (high - low)) / 1e3  # never wider than the range, by rounding
    amplitude = (-width, 0.0) if high <= 0.0 else (0.0, width)
    held = min(max(round(float(np.rad2deg(rest)), 3), low), high)
    return GuessedChannel(str(model.actuator(actuator).name), (low, high), amplitude, held, origin)


def guess_parameters(
    model: mujoco.MjModel, root: ET.Element, pads: Sequence[int]
) -> dict[str, GuessedParameter]:
    """Return the numbers that servos, or pads, share, by name; where they differ, one for each kind.

    Args:
        model: the robot.
        root: its MJCF, which has the numbers.
        pads: the pads.
    """
    found: dict[str, GuessedParameter] = {}
    servos = root.findall("actuator/position")
    if len(servos) == model.nu:
        names = [str(element.get("name")) for element in servos]
        gains = [float(gain) for gain in model.actuator_gainprm[:, 0]]
        found |= _by_kind("k_servo", "N m/rad", names, gains, "actuator/position", "kp", ["{}"] * len(names))
        limits = model.actuator_forcerange.tolist()
        if model.actuator_forcelimited.all() and all(low == -high for low, high in limits):
            highs, texts = [high for _, high in limits], ["-{} {}"] * len(names)
            found |= _by_kind("torque_limit", "N m", names, highs, "actuator/position", "forcerange", texts)
    names = [str(model.geom(pad).name) for pad in pads]
    written = {element.get("name") for element in root.iter("geom")}
    if written >= set(names):
        frictions = [_friction_of(model, pad).tolist() for pad in pads]
        texts = [f"{{}} {spin!r} {roll!r}" for _, spin, roll in frictions]
        slides = [slide for slide, _, _ in frictions]
        found |= _by_kind("mu_pads", "1", names, slides, ".//geom", "friction", texts, each=True)
    return found


def _by_kind(
    name: str,
    unit: str,
    parts: Sequence[str],
    values: Sequence[float],
    path: str,
    attribute: str,
    texts: Sequence[str],
    each: bool = False,
) -> dict[str, GuessedParameter]:
    """Return a named number, or one for each kind of part where values differ, called after its first part.

    Args:
        name, unit: of the number.
        parts: the names of what it belongs to. XPath has no escape: a name with both quotes gives no number.
        values: the number of each part.
        path, attribute: the XPath of the parts, and what is set.
        texts: what is written for each part; ``{}`` is the number.
        each: whether parts are named one by one even where all are alike.
    """
    if any(set(part) >= _QUOTES for part in parts):
        return {}
    kinds: dict[float, dict[str, str]] = {}
    for part, value, text in zip(parts, values, texts, strict=True):
        quote = '"' if "'" in part else "'"
        kinds.setdefault(value, {})[f"{path}[@name={quote}{part}{quote}]/@{attribute}"] = text
    if len(kinds) == 1 and not each:
        kinds = {values[0]: {f"{path}/@{attribute}": texts[0]}}
    firsts = {value: parts[list(values).index(value)] for value in kinds}
    return {
        name if len(kinds) == 1 else f"{name}_{_KEY_BREAKS.sub('_', firsts[value])}": GuessedParameter(
            value, unit, _sets(paths)
        )
        for value, paths in kinds.items()
    }


def _sets(paths: Mapping[str, str]) -> str:
    """Return the TOML text of what a parameter sets."""
    if set(paths.values()) == {"{}"}:
        return json.dumps(list(paths), ensure_ascii=False)
    texts = (f'{json.dumps(path, ensure_ascii=False)} = "{text}"' for path, text in paths.items())
    return f"{{ {', '.join(texts)} }}"


def _friction_of(model: mujoco.MjModel, pad: int) -> NDArray[np.float64]:
    """Return the friction that MuJoCo uses between a pad and the first thing around that it can touch."""
    around = [geom for geom in surroundings(model) if can_touch(model, pad, geom)]
    return mixed_friction(model, pad, around[0]) if around else np.array(model.geom_friction[pad])


def _marker(model: mujoco.MjModel, pads: Sequence[int]) -> tuple[str, str]:
    """Return the site that stands for the robot's motion, and what that rests on.

    It is a site in the middle of the trunk, or else one that is called marker, or else a new one. A site on a
    leg moves with its steps, so it stands for the robot's motion in a chain of links alone.
    """
    base, legs = trunk(model), limbs_of(model, pads)
    sites = [i for i in range(model.nsite) if model.site(i).name]
    on_trunk = [i for i in sites if int(model.site_bodyid[i]) == base]
    called = [i for i in sites if any(word in model.site(i).name.lower() for word in _MARKERS)]
    if on_trunk:
        best = min(on_trunk, key=lambda i: (*_rank(model, i), i))
        return str(model.site(best).name), f"marker: the site {model.site(best).name} of the trunk"
    if called and len(legs) < _LEGS:
        return str(model.site(called[0]).name), "marker: the site that is called so, as the trunk has none"
    name = unused(NEW_MARKER, {str(model.site(i).name) for i in sites})
    other = f"; {model.site(called[0]).name} moves with a leg" if called else ""
    return name, f"marker: a site added to the trunk, which has none{other}"


def _rank(model: mujoco.MjModel, site: int) -> tuple[bool, int, float]:
    """Return how far a site of the trunk is from being its middle: by its name, then by its distance, m."""
    name, base = model.site(site).name.lower(), trunk(model)
    own = name == model.body(base).name.lower()
    word = next((i for i, word in enumerate(_TRUNK_SITES) if word in name), len(_TRUNK_SITES))
    return not own, word, float(np.linalg.norm(model.site_pos[site] - model.body_ipos[base]))


def _touchable(model: mujoco.MjModel) -> list[int]:
    """Return the robot's geoms that collide with something around it."""
    around = surroundings(model)
    own = np.flatnonzero(robot_bodies(model)[model.geom_bodyid]).tolist()
    return [geom for geom in own if any(can_touch(model, geom, other) for other in around)]


def _passive_hinges(model: mujoco.MjModel) -> list[str]:
    """Return the robot's hinges that no actuator turns, without those by which the trunk moves."""
    driven = every_driven_joint(model)
    own, base, hinge = robot_bodies(model), trunk(model), int(mujoco.mjtJoint.mjJNT_HINGE)
    found = [
        str(model.joint(i).name)
        for i in range(model.njnt)
        if int(model.jnt_type[i]) == hinge
        and i not in driven
        and own[model.jnt_bodyid[i]]
        and int(model.jnt_bodyid[i]) != base
    ]
    return [name for name in found if name]
