"""The instruments of a robot: the sensors that metrics and diagnosis read, and the model with them."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.core.kept import Kept
from gaitopt.effects.active import RobotEffects
from gaitopt.effects.added import added_name, is_added, transferred
from gaitopt.effects.parts import Parts
from gaitopt.problem.mjcf import spec_of
from gaitopt.problem.model import assets_for, build_model, compile_for, content_of, nominal_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import START
from gaitopt.robot.signals import AXES, MARKER, joint_signal, kind_of, site_signals
from gaitopt.robot.tree import has_obstacles

CONTACTS_WITHIN = "contacts_within"
"""Raw signal: the number of contacts between the robot's own parts, where there are obstacles."""

_LEVEL = added_name("level", "trunk")
"""A site on a trunk that is drawn turned, which is level then."""

SITE_POSITION, SITE_TURN = "site_position", "site_turn"
"""Kinds of raw signals of a site: coordinates in the world, m, and a quaternion; see `simulation.sites`."""


@dataclass(frozen=True)
class Instrument:
    """One sensor: the signals it gives, in the order of its numbers; None for a number not kept."""

    element: str
    attributes: dict[str, str]
    signals: tuple[str | None, ...]


def instruments(problem: Problem, model: mujoco.MjModel) -> list[Instrument]:
    """Return the sensors that metrics and diagnosis read, for any robot, from its roles."""
    marker = problem.roles.marker
    found = [] if marker is None else [Instrument("framepos", {"objtype": "site", "objname": marker}, MARKER)]
    found += [
        Instrument(
            "framequat", _heading_of(problem, model), ("heading.w", "heading.x", "heading.y", "heading.z")
        ),
        *_contact_counters(problem, model),
    ]
    among = {} if _has_obstacles(problem, model) else {"body2": "world"}
    for name in problem.channel_names:
        found.append(Instrument("actuatorpos", {"actuator": name}, (f"position.{name}",)))
        found.append(Instrument("actuatorvel", {"actuator": name}, (f"rate.{name}",)))
        found.append(Instrument("actuatorfrc", {"actuator": name}, (f"torque.{name}",)))
    for name in filter(None, (model.joint(i).name for i in scalar_joints(model))):
        found.append(Instrument("jointpos", {"joint": name}, (joint_signal(name),)))
    for pad in problem.roles.pads:
        found.append(
            Instrument(
                "contact",
                {"geom1": pad, **among, "reduce": "netforce", "data": "force"},
                tuple(f"load.{pad}.{axis}" for axis in AXES),
            )
        )
        found.append(
            Instrument(
                "framelinvel",
                {"objtype": "geom", "objname": pad},
                tuple(f"pad_speed.{pad}.{axis}" for axis in AXES),
            )
        )
    for site in problem.observed:
        named = {"objtype": "site", "objname": site}
        found.append(Instrument("framepos", named, tuple(f"{SITE_POSITION}.{site}.{axis}" for axis in AXES)))
        found.append(Instrument("framequat", named, tuple(f"{SITE_TURN}.{site}.{part}" for part in "wxyz")))
    return found


def _heading_of(problem: Problem, model: mujoco.MjModel) -> dict[str, str]:
    """Return what the heading is sensed of: the trunk, or a level site on one that is drawn turned.

    Raises:
        GaitoptError: the trunk has no name.
    """
    trunk = Parts(model, problem.roles, problem.channel_names).trunk
    name = str(model.body(trunk).name)
    if not name:
        raise GaitoptError(
            f"{problem.model_path}: the body that carries the robot has no name; give it one: "
            '<body name="trunk" …>'
        )
    levels = [model.site(i).name for i in range(model.nsite)]
    return (
        {"objtype": "site", "objname": _LEVEL} if _LEVEL in levels else {"objtype": "xbody", "objname": name}
    )


def _contact_counters(problem: Problem, model: mujoco.MjModel) -> list[Instrument]:
    """Return what counts the contacts with the ground, and all contacts.

    Where there are obstacles and loose things, contacts are those of the robot's trees, and those between its
    own parts are counted too: the rest is with the surroundings; see `rollout`.
    """
    if not _has_obstacles(problem, model):
        return [
            Instrument(
                "contact",
                {"body2": "world", "reduce": "mindist", "data": "found dist"},
                ("contacts", "depth"),
            ),
            Instrument("contact", {"data": "found"}, ("contacts_all",)),
        ]
    trunk = str(model.body(Parts(model, problem.roles, problem.channel_names).trunk).name)
    return [
        Instrument(
            "contact",
            {"subtree1": trunk, "reduce": "mindist", "data": "found dist"},
            ("contacts_all", "depth"),
        ),
        Instrument("contact", {"subtree1": trunk, "subtree2": trunk, "data": "found"}, (CONTACTS_WITHIN,)),
    ]


def _has_obstacles(problem: Problem, model: mujoco.MjModel) -> bool:
    parts = Parts(model, problem.roles, problem.channel_names)
    return has_obstacles(model, parts.named_bodies)


def _add_level(root: ET.Element, problem: Problem) -> None:
    """Add a site to a trunk that is drawn turned: it has the world's axes in the reference pose."""
    parts = Parts(compile_for(problem, root), problem.roles, problem.channel_names)
    drawn = np.array(parts.at_zero.xquat[parts.trunk])
    name = parts.model.body(parts.trunk).name
    body = next((one for one in root.iter("body") if name and one.get("name") == name), None)
    if body is None or np.array_equal(drawn, [1.0, 0.0, 0.0, 0.0]):
        return
    back = np.empty(4)
    mujoco.mju_negQuat(back, drawn)
    ET.SubElement(body, "site", name=_LEVEL, quat=" ".join(map(repr, back.tolist())))


def measurable_signals(problem: Problem) -> list[str]:
    """Return the signals of a robot that a data set may hold: of marker, joints and sites.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    model = build_model(problem)
    named = [signal for one in instruments(problem, model) for signal in one.signals if signal]
    named_sites = (model.site(i).name for i in range(model.nsite))
    sites = [site for site in named_sites if site and not is_added(site)]
    measured = [signal for signal in named if kind_of(signal) in ("marker", "joint")]
    return [*measured, *(signal for site in sites for signal in site_signals(site))]


@dataclass(frozen=True)
class InstrumentedRobot:
    """A problem's robot with its sensors and its effects.

    Attributes:
        model: the model, with the parts that its effects need; `RobotEffects.edit` then makes it the robot
            with effects. Its keyframe ``start`` is the nominal robot's.
        signals: the signal in each place of ``sensordata``; None where it is not kept.
        effects: the effects that change this robot or its measurement.
    """

    model: mujoco.MjModel
    signals: tuple[str | None, ...]
    effects: RobotEffects


def build_instrumented(problem: Problem) -> InstrumentedRobot:
    """Return a problem's robot with its sensors and its effects.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem, or an effect does not
            apply to it.
    """
    nominal = _nominal(problem)
    model = copy.copy(nominal.model)
    effects = RobotEffects.of(
        problem.effects, Parts(model, problem.roles, problem.channel_names), problem.source
    )
    if not effects.changes_robot:
        return InstrumentedRobot(model, nominal.signals, effects)
    return _with_structure(problem, nominal, effects)


@dataclass(frozen=True)
class _Nominal:
    """A nominal robot with its sensors: what robots with effects begin with. Many share it; none changes it.

    Attributes:
        root: its MJCF.
        signals: the signal in each place of ``sensordata``; None where it is not kept.
        model: the compiled model.
    """

    root: ET.Element
    signals: tuple[str | None, ...]
    model: mujoco.MjModel


_KEPT = 8
"""Nominal robots that a process keeps, those used last."""

_nominals: Kept[tuple[object, ...], _Nominal] = Kept(_KEPT)


def _nominal(problem: Problem) -> _Nominal:
    """Return a problem's nominal robot, compiled and brought to rest once for all with the same content.

    A diagnosis builds a thousand robots that differ in their effects alone.
    """
    if problem.carried is None:  # its files may change on the disk
        return _compiled(problem)
    file = problem.file.model_copy(update={"effects": {}})
    text, files = content_of(replace(problem, file=file))
    key = (str(problem.model_path), text, tuple(files), problem.observed)
    return _nominals.get(key, lambda: _compiled(problem))


def _compiled(problem: Problem) -> _Nominal:
    root = ET.fromstring(nominal_mjcf(problem))
    signals = _add_sensors(root, problem)
    return _Nominal(root, tuple(signals), compile_for(problem, root))


def _with_structure(problem: Problem, nominal: _Nominal, effects: RobotEffects) -> InstrumentedRobot:
    """Return a nominal robot with the parts that effects need."""
    assets = assets_for(problem, nominal.root)
    spec = spec_of(nominal.root, problem.model_path, assets)
    for key in list(spec.keys):
        spec.delete(key)
    effects.restructure(spec)
    spec.add_key(name=START)
    try:
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise GaitoptError(f"{problem.model_path}: with effects: {error}") from None
    model.key_qpos[0] = transferred(nominal.model.keyframe(START).qpos, nominal.model, model)
    unkept = [None] * (model.nsensordata - len(nominal.signals))
    return InstrumentedRobot(model, (*nominal.signals, *unkept), effects)


def _add_sensors(root: ET.Element, problem: Problem) -> list[str | None]:
    """Replace an MJCF's sensors by the instruments; return the signal in each place of ``sensordata``."""
    for element in root.findall("sensor"):
        root.remove(element)
    _add_level(root, problem)
    bare = compile_for(problem, root)
    sensors = ET.SubElement(root, "sensor")
    signals: list[str | None] = []
    for instrument in instruments(problem, bare):
        ET.SubElement(sensors, instrument.element, instrument.attributes)
        signals.extend(instrument.signals)
    return signals


def scalar_joints(model: mujoco.MjModel) -> list[int]:
    """Return the ids of the robot's own hinge and slide joints."""
    scalar = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    own = [i for i in range(model.njnt) if not is_added(model.joint(i).name)]
    return [i for i in own if int(model.jnt_type[i]) in scalar]
