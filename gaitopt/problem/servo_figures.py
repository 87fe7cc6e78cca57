"""Figures of the servos of a problem: those of its MJCF, with the effects that it switches on.

They are absolute, so that the servos of two robots can be compared: an effect such as ``servo_gain`` is a
ratio to the nominal robot's own gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.effects.library.servo import torque_limits
from gaitopt.effects.parts import ALL, Parts
from gaitopt.problem.problem import Problem

Array = NDArray[np.float64]

_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))


@dataclass(frozen=True)
class Term:
    """A figure of the nominal servos, and the effect that changes it.

    Attributes:
        effect: name of the effect.
        nominal: returns the figure of each nominal servo, shape (nu,).
        ratio: whether the effect's value multiplies the figure; else it is the figure itself, and servos of
            different figures keep their proportion.
    """

    effect: str
    nominal: Callable[[Parts], Array]
    ratio: bool = False

    def with_effect(self, nominal: Array, value: float) -> Array:
        """Return the figure of some servos with the effect at a value, shape (n,)."""
        if self.ratio:
            return nominal * value
        most = float(nominal.max(initial=0.0))
        if not 0.0 < most < math.inf:
            return np.full(len(nominal), value)
        return np.where(nominal == most, value, nominal * (value / most))

    def of(self, problem: Problem, nominal: Parts) -> Array:
        """Return the figure of each servo of a problem, shape (nu,)."""
        figures = self.nominal(nominal)
        for active in problem.effects:
            if active.effect.name == self.effect:
                here = [i for i, name in enumerate(nominal.channels) if active.target in (ALL, name)]
                figures[here] = self.with_effect(figures[here], active.value)
        return figures


@dataclass(frozen=True)
class ServoFigure:
    """One figure of a servo.

    Attributes:
        name: what it is.
        unit: its unit; empty for a ratio.
        terms: what adds up to it.
        none: the value of a servo without it.
    """

    name: str
    unit: str
    terms: tuple[Term, ...]
    none: float = 0.0

    def of(self, problem: Problem, nominal: Parts) -> Array:
        """Return the figure of each servo of a problem, shape (nu,)."""
        total: Array = np.sum([term.of(problem, nominal) for term in self.terms], axis=0)
        return total


def check_servos(problem: Problem, nominal: Parts, channels: Mapping[str, object]) -> None:
    """Check that channels are servos whose figures can be compared.

    Args:
        problem: the problem, for messages.
        nominal: its nominal robot.
        channels: the channels.

    Raises:
        GaitoptError: an actuator turns no joint, or has a gear.
    """
    joints = nominal.servo_joints
    for name in channels:
        index = list(nominal.channels).index(name)
        gear = float(nominal.model.actuator_gear[index, 0])
        if joints[index] < 0:
            raise GaitoptError(f"{problem.source}: channels.{name}: its actuator does not turn a joint")
        if gear != 1.0:
            raise GaitoptError(
                f"{problem.model_path}: actuator {name}: found a gear of {gear:g}; allowed: 1, so that the "
                "figures of two servos can be compared"
            )


def _constant(value: float) -> Callable[[Parts], Array]:
    return lambda parts: np.full(len(parts.channels), value)


def _gain(parts: Parts) -> Array:
    return np.array(parts.model.actuator_gainprm[parts.servos, 0])


def _speed_feedback(parts: Parts) -> Array:
    """Return kv, which MuJoCo keeps as minus the bias on the speed."""
    return np.array(0.0 - parts.model.actuator_biasprm[parts.servos, 2])


def _of_joints(field: str) -> Callable[[Parts], Array]:
    """Return what reads a field of the driven joints; 0 for an actuator that turns none."""

    def read(parts: Parts) -> Array:
        values, joints = getattr(parts.model, field), parts.servo_joints
        return np.array([values[parts.model.jnt_dofadr[j]] if j >= 0 else 0.0 for j in joints], dtype=float)

    return read


def _lag(parts: Parts) -> Array:
    model = parts.model
    filtered = np.isin(model.actuator_dyntype[parts.servos], _FILTERS)
    return np.where(filtered, model.actuator_dynprm[parts.servos, 0], 0.0)


GAIN = ServoFigure("gain", "N m/rad", (Term("servo_gain", _gain, ratio=True),))
SPEED_FEEDBACK = ServoFigure(
    "feedback of speed", "N m s/rad", (Term("servo_damping", _speed_feedback, ratio=True),)
)
JOINT_DAMPING = Term("servo_damping", _of_joints("dof_damping"), ratio=True)
BACK_EMF = Term("servo_back_emf", _constant(0.0))
TORQUE_LOST = ServoFigure("torque lost with speed", "N m s/rad", (JOINT_DAMPING, BACK_EMF))


def _one(
    name: str, unit: str, effect: str, nominal: Callable[[Parts], Array], none: float = 0.0
) -> ServoFigure:
    return ServoFigure(name, unit, (Term(effect, nominal),), none)


FIGURES = (
    GAIN,
    SPEED_FEEDBACK,
    TORQUE_LOST,
    _one("torque limit", "N m", "servo_torque_limit", torque_limits, math.inf),
    _one("speed limit", "rad/s", "servo_speed_limit", _constant(math.inf), math.inf),
    _one("rotor inertia", "kg m^2", "servo_inertia", _of_joints("dof_armature")),
    _one("dead band", "rad", "servo_deadband", _constant(0.0)),
    _one("free play", "rad", "servo_backlash", _constant(0.0)),
    _one("dry friction", "N m", "servo_friction", _of_joints("dof_frictionloss")),
    _one("friction by load", "", "servo_friction_load", _constant(0.0)),
    _one("stiction", "N m", "servo_stiction", _constant(0.0)),
    _one("lag", "s", "servo_lag", _lag),
    _one("resolution", "rad", "servo_resolution", _constant(0.0)),
    _one("latency", "s", "command_latency", _constant(0.0)),
    _one("jitter", "s", "command_jitter", _constant(0.0)),
)
"""Every figure that belongs to a servo, wherever it is mounted."""
