"""ArcFold on the ground, by code of its own on the MJCF that `gaitopt model` writes.

The servos are those of `other_hand`. MuJoCo finds contacts and solves for forces, but this file steps it: it
sets the coefficients of each contact, by direction, load and chance, between the collisions and the forces.
Hinges are springs and dampers of this file. The robot's size is changed in the text of the model.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from other_hand import CHANNELS, SETTLE_S, Mechanism, Planted, planted
from other_servo import EFFECTS, Log, Servo

Array = NDArray[np.float64]

ROW_S = 1e-3
"""Time between two rows of commands, and between two samples, s."""

HINGES = ("first_left", "mid_left", "last_left", "first_right", "mid_right", "last_right")
PADS = ("foot1_pad", "foot2_pad")
TRUNK, MARKER = "base_bot", "end_effector"
GRAVITY = 9.81
LOAD_S = 0.02
"""Time constant of the load on which a coefficient depends, s."""

OFF_S = 0.03
"""A pad that was off the ground for this long has made a step, s."""

SLIP_M_S = 1e-3
"""A pad that is slower than this sticks, m/s."""

SQUARE = {"mid_act": (0.25, 90.0), "foot1": (0.0, -90.0), "foot2": (0.5, -90.0)}
"""The hand-tuned gait: advance in cycles, and travel in degrees during the first half of a cycle."""


@dataclass(frozen=True)
class Errors:
    """Small errors of one robot, relative where not said otherwise.

    Attributes:
        masses, stiffness: of the bodies and of the hinges, by name.
        grip: of the coefficient of each geom, by name.
        servos: of limit, gain and damping of each servo, and its trim, rad; shape (4, 3).
        slope: of the floor, along and across, rad.
        grip_sd: spread of a pad's coefficient from step to step.
    """

    masses: Mapping[str, float] = field(default_factory=dict)
    stiffness: Mapping[str, float] = field(default_factory=dict)
    grip: Mapping[str, float] = field(default_factory=dict)
    servos: Array = field(default_factory=lambda: np.zeros((4, 3)))
    slope: tuple[float, float] = (0.0, 0.0)
    grip_sd: float = 0.0


@dataclass(frozen=True)
class Numerics:
    """Time step, s, MuJoCo's integrator, and the stiffness of the friction cones."""

    step_s: float = 2e-4
    implicit: bool = True
    impratio: float = 10.0


@dataclass(frozen=True)
class Walk:
    """What a robot did, from gait time 0.

    Attributes:
        time: s, shape (n,).
        marker: m, shape (n, 3).
        middle: angle of the middle joint, rad, shape (n,).
    """

    time: Array
    marker: Array
    middle: Array


def square(period_s: float, seconds: float) -> Array:
    """Return the targets of the hand-tuned gait, rad, one row every `ROW_S`, shape (n, 3)."""
    cycles = np.arange(round(seconds / ROW_S) + 1) * ROW_S / period_s
    columns = [
        np.where(np.mod(cycles + advance + 1e-9, 1.0) < 0.5, math.radians(travel), 0.0)
        for advance, travel in SQUARE.values()
    ]
    return np.stack(columns, axis=1)


def walk(
    mjcf: str,
    effects: Planted,
    errors: Errors,
    rows: Array,
    numerics: Numerics = Numerics(),
    rng: np.random.Generator | None = None,
) -> Walk:
    """Return the walk of a robot.

    Args:
        mjcf: the nominal model.
        effects: what is planted on it.
        errors: its small errors.
        rows: targets of the servos, rad, one row every `ROW_S`, shape (n, 3).
        numerics: how it is simulated.
        rng: chance of the grip and of the start; None: none.
    """
    robot = _Walker(mjcf, effects, errors, numerics, rng)
    logs = [Log(column, held=0.0, row_s=ROW_S) for column in rows.T]
    marker, middle = zip(*robot.play(logs, lambda: robot.seen), strict=True)
    return Walk(np.arange(len(rows)) * ROW_S, np.array(marker), np.array(middle))


def apart(one: Array, other: Array) -> float:
    """Return the RMS distance of two paths from their first points on, m; both of shape (n, 3)."""
    return math.sqrt(float(np.mean(np.sum(((one - one[0]) - (other - other[0])) ** 2, axis=1))))


class _Walker(Mechanism):
    """A robot on the ground."""

    def __init__(
        self,
        mjcf: str,
        effects: Planted,
        errors: Errors,
        numerics: Numerics,
        rng: np.random.Generator | None,
    ):
        self.values = {name: value for (name, _), value in effects.items()}
        self.rng, self.errors = rng, errors
        of_servos = {key: value for key, value in effects.items() if key[0] in _OF_SERVOS}
        servos = [
            _with_errors(servo, errors.servos[:, i])
            for i, servo in enumerate(planted(mjcf, of_servos).values())
        ]
        sized = _resized(mjcf, self.values.get("geometry_scale", 1.0))
        super().__init__(sized, servos, self.values.get("servo_sag", 0.0), numerics.step_s)
        self._set_up(numerics)
        self._put(mujoco.MjModel.from_xml_string(sized))

    def _set_up(self, numerics: Numerics) -> None:
        """Apply what stays as it is during the walk."""
        model, value = self.model, self.values.get
        self.integrate = mujoco.mj_implicit if numerics.implicit else mujoco.mj_Euler
        model.opt.impratio = numerics.impratio
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
        along, across = self.errors.slope[0] + value("ground_slope", 0.0), self.errors.slope[1]
        level = math.cos(along) * math.cos(across)
        model.opt.gravity[:] = -GRAVITY * np.array([math.sin(along), math.sin(across), level])
        model.geom_solref[:, 0] *= value("contact_compliance", 1.0)
        trunk = model.body(TRUNK).id
        for name, error in self.errors.masses.items():
            model.body(name).mass *= 1.0 + error
            model.body(name).inertia *= 1.0 + error
        model.body_inertia[:] *= value("link_inertia", 1.0)
        model.body_mass[trunk] += value("payload_mass", 0.0)
        self.weight = GRAVITY * float(model.body_mass.sum())
        model.body_ipos[trunk, 0] += value("com_offset", 0.0)
        self.data.xfrc_applied[trunk, 0] = -value("tether_drag", 0.0)
        self._set_up_hinges()
        self._set_up_grip()
        mujoco.mj_setConst(model, self.data)

    def _set_up_hinges(self) -> None:
        """Take springs and dampers out of the model: `_bend` has them."""
        model, value = self.model, self.values.get
        joints = [model.joint(name) for name in HINGES]
        errors = np.array([1.0 + self.errors.stiffness.get(name, 0.0) for name in HINGES])
        self.hinge_angles = np.array([int(joint.qposadr[0]) for joint in joints])
        self.hinge_speeds = np.array([int(joint.dofadr[0]) for joint in joints])
        stiffness = np.array([float(joint.stiffness[0]) for joint in joints])
        driven = np.isin(HINGES, list(CHANNELS.values()))
        damping = np.where(driven, 0.0, model.dof_damping[self.hinge_speeds])
        self.stiffness = stiffness * errors * value("hinge_stiffness", 1.0)
        self.cubic = np.full(len(HINGES), value("hinge_nonlinearity", 0.0))
        self.damping = damping * value("hinge_damping", 1.0)
        for joint, own in zip(joints, driven, strict=True):
            joint.stiffness[:] = 0.0
            if not own:
                model.dof_damping[joint.dofadr[0]] = 0.0
        self.without_servo, self.with_servo = np.flatnonzero(~driven), np.flatnonzero(driven)
        self.passive, self.driven = self.hinge_speeds[~driven], self.hinge_speeds[driven]
        self.dry = value("hinge_friction", 0.0)
        model.dof_frictionloss[self.passive] = self.dry

    def _set_up_grip(self) -> None:
        model, value = self.model, self.values.get
        self.grip, self.pads = model.geom_friction[:, 0].copy(), [model.geom(name).id for name in PADS]
        for geom in range(model.ngeom):
            self.grip[geom] *= 1.0 + self.errors.grip.get(model.geom(geom).name, 0.0)
            self.grip[geom] *= value("pad_friction" if geom in self.pads else "body_friction", 1.0)
        ratio = value("pad_imbalance", 1.0)
        for pad, factor in zip(self.pads, (2.0 * ratio / (1.0 + ratio), 2.0 / (1.0 + ratio)), strict=True):
            self.grip[pad] *= factor
        self.sd = max(self.errors.grip_sd, value("grip_variation", 0.0)) if self.rng is not None else 0.0
        self.off_s = dict.fromkeys(self.pads, OFF_S)
        model.geom_friction[:, 0] = self.grip
        self.aside, self.backward = value("friction_anisotropy", 1.0), value("friction_direction", 1.0)
        self.exponent = value("friction_load", 0.0)
        self.by_contact = (self.aside, self.backward, self.exponent) != (1.0, 1.0, 0.0)
        self.load, self.push = np.zeros(model.ngeom), np.zeros(model.ngeom)
        self.mean_load = 0.0

    def _put(self, whole: mujoco.MjModel) -> None:
        """Put the robot to the start of the nominal model, and let its weight come to rest."""
        turned = 0.0 if self.rng is None else float(self.rng.normal(0.0, 0.005))
        self.place([0.0 if self.rng is None else float(self.rng.normal(0.0, 0.005)) for _ in CHANNELS])
        self.data.qpos[:7] = whole.key_qpos[0, :7]
        yaw = np.array([math.cos(0.5 * turned), 0.0, 0.0, math.sin(0.5 * turned)])
        mujoco.mju_mulQuat(self.data.qpos[3:7], yaw, whole.key_qpos[0, 3:7])
        self.steps = 0

    @property
    def seen(self) -> tuple[Array, float]:
        """Where the marker is, m, and the angle of the middle joint, rad."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.site(MARKER).xpos.copy(), self.angles[0]

    def advance(self, targets: Sequence[float], powered: Sequence[float]) -> None:
        """Advance by a step under these targets, rad."""
        model, data = self.model, self.data
        self.drive(targets, powered)
        self._bend()
        mujoco.mj_fwdPosition(model, data)
        geoms = data.contact.geom.max(axis=1) if data.ncon else _NO_GEOMS
        if self.sd:
            self._draw_grip(geoms)
        if self.by_contact and data.ncon:
            self._set_grip(geoms)
            mujoco.mj_makeConstraint(model, data)
            mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        if self.by_contact:
            self._feel(geoms)
        self.integrate(model, data)

    def _bend(self) -> None:
        """Add the torques of the hinges to those of the servos."""
        data = self.data
        angles, speeds = data.qpos[self.hinge_angles], data.qvel[self.hinge_speeds]
        torques = -(self.stiffness + self.cubic * angles**2) * angles - self.damping * speeds
        data.qfrc_applied[self.passive] = torques[self.without_servo]
        data.qfrc_applied[self.driven] += torques[self.with_servo]
        if self.dry:
            self.model.dof_frictionloss[self.driven] += self.dry

    def _draw_grip(self, geoms: Array) -> None:
        """Draw the coefficient of a pad anew where it makes a step."""
        touching = set(geoms.tolist())
        for pad in self.pads:
            if pad in touching and self.off_s[pad] >= OFF_S:
                self.model.geom_friction[pad, 0] = self.grip[pad] * self._drawn()
            self.off_s[pad] = 0.0 if pad in touching else self.off_s[pad] + self.step_s

    def _set_grip(self, geoms: Array) -> None:
        """Set the coefficients of the contacts along and across the way."""
        contacts = self.data.contact
        grip = self.model.geom_friction[geoms, 0]
        if self.exponent and self.mean_load:
            loads = np.maximum(self.load[geoms], 1e-9) / self.mean_load
            factors = np.clip(loads**-self.exponent, 0.2, 5.0)
            grip = grip * np.where(self.load[geoms] > 0.02 * self.weight, factors, 1.0)
        backward = np.isin(geoms, self.pads) & (self.push[geoms] > 0.0)
        pair = np.stack([grip * np.where(backward, self.backward, 1.0), grip * self.aside], axis=1)
        frames = np.abs(contacts.frame)
        first_is_along = (frames[:, 3] > frames[:, 6])[:, None]
        contacts.friction[:, :2] = np.where(first_is_along, pair, pair[:, ::-1])

    def _drawn(self) -> float:
        """Return a factor on a pad's coefficient for one step of its walk; its mean is 1."""
        assert self.rng is not None  # as `sd` is not 0
        spread = math.log1p(self.sd**2)
        return math.exp(self.rng.normal(-0.5 * spread, math.sqrt(spread)))

    def _feel(self, geoms: Array) -> None:
        """Measure the loads of the contacts, and which way the ground pushes the robot there."""
        model, data, force = self.model, self.data, np.zeros(6)
        pressed, pushed = np.zeros(model.ngeom), np.zeros(model.ngeom)
        for one, geom in enumerate(geoms.tolist()):
            mujoco.mj_contactForce(model, data, one, force)
            pressed[geom] += force[0]
            pushed[geom] += float(data.contact.frame[one].reshape(3, 3)[1:, 0] @ force[1:3])
        self._sense_slip(pushed)
        share = np.where(self.load > 0.02 * self.weight, self.step_s / LOAD_S, 1.0)
        self.load += share * (pressed - self.load)
        self.steps += 1
        if self.steps * self.step_s < 0.9 * SETTLE_S:  # at rest it is known how many geoms carry the robot
            carrying = int(np.sum(self.load > 0.02 * self.weight))
            self.mean_load = self.weight / max(1, carrying)

    def _sense_slip(self, pushed: Array) -> None:
        """Set which pads slip backward, or would: where one sticks, the ground's push tells."""
        speed = np.zeros(6)
        for pad in self.pads:
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_GEOM, pad, speed, 0)
            if abs(speed[3]) > SLIP_M_S:
                self.push[pad] = -speed[3]
            elif pushed[pad]:
                self.push[pad] = pushed[pad]


_NO_GEOMS = np.empty(0, dtype=np.intp)

_OF_SERVOS = {*EFFECTS, "servo_damping", "channel_timing"} - {"ground_slope"}
"""Effects that `planted` knows; the slope is the floor's here."""


def _with_errors(servo: Servo, errors: Array) -> Servo:
    limit, gain, damping, trim = errors.tolist()
    return replace(
        servo,
        limit=servo.limit * (1.0 + limit),
        gain=servo.gain * (1.0 + gain),
        back_emf=servo.back_emf * (1.0 + damping),
        trim=servo.trim + trim,
    )


def _resized(mjcf: str, scale: float) -> str:
    """Return the model with all lengths of the robot scaled, masses kept."""
    if scale == 1.0:
        return mjcf
    root = ET.fromstring(mjcf)
    for kept in root.findall("./default//geom"):
        _scale(kept, "size", scale)
    for body in root.findall("./worldbody/body"):
        for element in body.iter():
            _scale(element, "pos", scale)
            if element.tag == "geom":
                _scale(element, "size", scale)
    for key in root.findall("./keyframe/key"):
        pose = [float(one) for one in key.attrib["qpos"].split()]
        key.set("qpos", " ".join(repr(one * (scale if i < 3 else 1.0)) for i, one in enumerate(pose)))
    return ET.tostring(root, encoding="unicode")


def _scale(element: ET.Element, name: str, scale: float) -> None:
    if name in element.attrib:
        element.set(name, " ".join(repr(scale * float(one)) for one in element.attrib[name].split()))
