"""ArcFold held in the hand, by code of its own on the MJCF that `gaitopt model` writes.

MuJoCo moves the mechanism, with another integrator and a fifth of the usual step. The servos are those of
`other_servo`: this file takes the actuators out of the model, and applies their torques itself. Dry friction
is MuJoCo's, set anew in each step; free play is a rotor between two stops.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray
from other_servo import EFFECTS, Log, Servo, followed

Array = NDArray[np.float64]

STEP_S = 2e-4
"""Time step, s."""

SETTLE_S = 0.5
"""How long the servos hold their first angles before a recording, s."""

CHANNELS = {"mid_act": "mid_left", "foot1": "foot1", "foot2": "foot2"}
"""The joint that each servo turns."""

HORN = 0.05
"""Share of a servo's inertia and damping that is on the far side of its free play: horn and output shaft."""

SUPPLY_S = 0.01
"""Time constant with which a shared supply follows the torques, s."""

_STIFF = [5e-4, 1.0], [0.9999, 0.9999, 1e-3, 0.5, 2.0]
"""Time constant, damping ratio and impedance of dry friction and of stops."""

Seen = TypeVar("Seen")

Planted = Mapping[tuple[str, str], float]
"""Values of effects by name and target, ``all`` or a channel."""


@cache
def nominal(mjcf: str) -> Mapping[str, Servo]:
    """Return the nominal servo of each channel.

    Its damping is on the joint: torque that is lost with speed, whatever the limit.
    """
    model = mujoco.MjModel.from_xml_string(mjcf)
    servos = {}
    for channel, joint in CHANNELS.items():
        actuator, dof = model.actuator(channel), model.joint(joint).dofadr[0]
        servos[channel] = Servo(
            gain=float(actuator.gainprm[0]),
            damping=-float(actuator.biasprm[2]),
            limit=float(actuator.forcerange[1]),
            lag_s=0.0,
            friction=float(model.dof_frictionloss[dof]),
            armature=float(model.dof_armature[dof]),
            back_emf=float(model.dof_damping[dof]),
        )
    return servos


def planted(mjcf: str, effects: Planted) -> dict[str, Servo]:
    """Return the servo of each channel; the sag of a shared supply is no servo's own."""
    servos = dict(nominal(mjcf))
    for (name, target), value in effects.items():
        if name != "servo_sag":
            for channel in CHANNELS if target == "all" else [target]:
                servos[channel] = _with(servos[channel], name, value)
    return servos


def _with(servo: Servo, name: str, value: float) -> Servo:
    if name == "servo_damping":
        return replace(servo, back_emf=servo.back_emf * value)
    if name == "channel_timing":
        return replace(servo, latency_s=servo.latency_s + value)
    return EFFECTS[name](servo, value)


def angles(mjcf: str, effects: Planted, logs: Sequence[Log], step_s: float = STEP_S) -> Array:
    """Return the angle of each servo's joint at the times of the logs' rows, before each row acts, rad.

    Args:
        mjcf: the nominal model.
        effects: what is planted.
        logs: the commands of each channel, with rows at the same times.
        step_s: time step, s; the time between two rows is a multiple of it.
    """
    servos = list(planted(mjcf, effects).values())
    hand = Mechanism(mjcf, servos, effects.get(("servo_sag", "all"), 0.0), step_s)
    hand.place([log.start for log in logs])
    return np.array(hand.play(logs, lambda: hand.angles))


@dataclass
class Mechanism:
    """The mechanism as it moves.

    Attributes:
        mjcf, servos, sag, step_s: as in `angles`.
    """

    mjcf: str
    servos: Sequence[Servo]
    sag: float
    step_s: float

    def __post_init__(self) -> None:
        model = mujoco.MjModel.from_xml_string(_without_actuators(self.mjcf, self.servos))
        model.opt.timestep, model.opt.integrator = self.step_s, int(mujoco.mjtIntegrator.mjINT_IMPLICIT)
        self.model, self.data = model, mujoco.MjData(model)
        self.drawn = 0.0
        names = list(CHANNELS.values())
        shafts = [f"shaft of {n}" if s.play else n for n, s in zip(names, self.servos, strict=True)]
        self.links = [int(model.joint(name).qposadr[0]) for name in names]
        self.rotors = [int(model.joint(name).qposadr[0]) for name in shafts]
        self.dofs = [int(model.joint(name).dofadr[0]) for name in shafts]
        for dof in self.dofs:
            model.dof_solref[dof], model.dof_solimp[dof] = _STIFF

    @property
    def angles(self) -> list[float]:
        """Angle of each servo's joint, rad."""
        return [float(self.data.qpos[link]) for link in self.links]

    def place(self, start: Sequence[float]) -> None:
        """Put the joints of the servos at rest at these angles, rad, and the rest of the loop with them."""
        model, pose = self.model, self.data.qpos
        for link, rotor, angle in zip(self.links, self.rotors, start, strict=True):
            pose[link] = pose[rotor] = angle
        for one in range(model.neq):
            led, leader = (int(model.jnt_qposadr[i[one]]) for i in (model.eq_obj1id, model.eq_obj2id))
            pose[led] = model.eq_data[one, 1] * pose[leader]

    def play(self, logs: Sequence[Log], see: Callable[[], Seen]) -> list[Seen]:
        """Follow the commands of the servos, and return what is seen at the time of each row, before it acts.

        Args:
            logs: the commands of each servo, with rows at the same times.
            see: called then.
        """
        each, before = round(logs[0].row_s / self.step_s), round(SETTLE_S / self.step_s)
        steps = before + each * (len(logs[0].rows) - 1)
        asked, powered = followed(self.servos, logs, steps, before, self.step_s)
        found = []
        for step, (targets, on) in enumerate(zip(asked.tolist(), powered.tolist(), strict=True)):
            if step >= before and (step - before) % each == 0:
                found.append(see())
            self.advance(targets, on)
        return [*found, see()]

    def advance(self, targets: Sequence[float], powered: Sequence[float]) -> None:
        """Advance by a step under these targets, rad."""
        self.drive(targets, powered)
        mujoco.mj_step(self.model, self.data)

    def drive(self, targets: Sequence[float], powered: Sequence[float]) -> None:
        """Set the torques and the dry friction of the servos for a step under these targets, rad."""
        model, data = self.model, self.data
        limits = [servo.limit * (1.0 - self.sag * self.drawn) for servo in self.servos]
        total = 0.0
        for i, (dof, servo) in enumerate(zip(self.dofs, self.servos, strict=True)):
            speed = float(data.qvel[dof])
            error = targets[i] - float(data.qpos[self.rotors[i]])
            error -= min(max(error, -servo.deadband), servo.deadband)
            torque = powered[i] * min(max(servo.gain * error, -limits[i]), limits[i])
            data.qfrc_applied[dof] = torque
            excess = servo.stiction * math.exp(-((speed / servo.stiction_speed) ** 2))
            model.dof_frictionloss[dof] = servo.friction + servo.load_share * abs(torque) + excess
            total += abs(torque)
        share = min(1.0, total / sum(servo.limit for servo in self.servos))
        self.drawn += self.step_s / SUPPLY_S * (share - self.drawn)


def _without_actuators(mjcf: str, servos: Sequence[Servo]) -> str:
    """Return the model without actuators and keyframe, with a shaft for each servo that has free play."""
    root = ET.fromstring(mjcf)
    for tag in ("actuator", "keyframe"):
        for child in root.findall(tag):
            root.remove(child)
    bodies = root.findall(".//body/joint[@name]")
    for joint, servo in zip(CHANNELS.values(), servos, strict=True):
        link = next(element for element in bodies if element.get("name") == joint)
        if servo.play:
            _turn(link, servo, HORN)
        shaft = _shaft(root, joint, servo.play) if servo.play else link
        _turn(shaft, servo, 1.0 - HORN if servo.play else 1.0)
        shaft.set("frictionloss", "1e-9")  # set in each step
    return ET.tostring(root, encoding="unicode")


def _turn(joint: ET.Element, servo: Servo, share: float) -> None:
    """Give a joint a share of the servo's damping and inertia."""
    joint.set("damping", repr(share * servo.back_emf))
    joint.set("armature", repr(share * servo.armature))


def _shaft(root: ET.Element, joint: str, play: float) -> ET.Element:
    """Add the shaft of a servo, which turns a joint between two stops; return its own joint."""
    world = root.find("worldbody")
    assert world is not None
    body = ET.SubElement(world, "body", name=f"shaft of {joint}")
    ET.SubElement(body, "inertial", pos="0 0 0", mass="1e-9", diaginertia="1e-12 1e-12 1e-12")
    shaft = ET.SubElement(body, "joint", name=f"shaft of {joint}", axis="0 0 1")
    tendons = root.find("tendon")
    tendons = ET.SubElement(root, "tendon") if tendons is None else tendons
    stop = {"solreflimit": " ".join(map(str, _STIFF[0])), "solimplimit": " ".join(map(str, _STIFF[1]))}
    between = ET.SubElement(tendons, "fixed", limited="true", range=f"{-play!r} {play!r}", **stop)
    ET.SubElement(between, "joint", joint=joint, coef="1")
    ET.SubElement(between, "joint", joint=f"shaft of {joint}", coef="-1")
    return shaft
