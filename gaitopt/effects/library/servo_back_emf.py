"""Torque that a powered servo loses with speed: the slope of its torque-speed line."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import added_name, owner_of
from gaitopt.effects.effect import Effect
from gaitopt.effects.library.servo import torque_scale
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_WHAT = "back_emf"

_LEAST_SPEED = 2.0
"""No-load speed of the slowest servos, rad/s: beyond it a slope would take more than all torque."""


def _damped(parts: Parts) -> str | None:
    if parts.model.dof_damping[parts.servo_dofs].any():
        return "the driven joints have damping, which is this slope; servo_damping scales it"
    return None


def _add_loss(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add an actuator to each servo that needs no command: it opposes motion outside of the torque limit.

    Without power the servo has no such torque, and the simulation cuts that of its added actuators, too.
    """
    for index in nominal.servos:
        servo = spec.actuators[index]
        spec.add_actuator(
            name=added_name(_WHAT, servo.name),
            trntype=servo.trntype,
            target=servo.target,
            gear=servo.gear,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        )


def _set_loss(parts: Parts, damping: float, _: float) -> None:
    """Set the torque lost per speed of the joint; the gear counts in speed and in torque."""
    model = parts.model
    for servo in parts.servos:
        added = model.actuator(added_name(_WHAT, model.actuator(servo).name)).id
        model.actuator_gainprm[added, 0] = 0.0
        model.actuator_biasprm[added, :3] = 0.0, 0.0, -damping / model.actuator_gear[added, 0] ** 2


SERVO_BACK_EMF = Effect(
    name="servo_back_emf",
    summary="torque lost in proportion to speed while the servo is powered, outside of its torque limit",
    parameter="damping_n_m_s_rad",
    unit="N m s/rad",
    neutral=0.0,
    low=0.0,
    high=1.0 / _LEAST_SPEED,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.15,
        "stall torque over no-load speed: datasheets give 0.1 to 0.2 s per 60 degrees, so 5 to 10 rad/s, for "
        "servos from 9 g to 25 kg cm",
    ),
    reference=torque_scale,
    reference_name="the nominal torque limit",
    allowed=(0.0, math.inf),
    target="any",
    on_joints=True,
    missing=_damped,
    unusual=6.0,
    structure=_add_loss,
    model=_set_loss,
)


def back_emf(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the torque that each actuator's servo loses with speed, N m s/rad, shape (nu,); 0 without."""
    lost = np.zeros(model.nu)
    for i in range(model.nu):
        name = model.actuator(i).name
        if name == added_name(_WHAT, owner_of(name)):
            gear = model.actuator_gear[i, 0]
            lost[model.actuator(owner_of(name)).id] -= model.actuator_biasprm[i, 2] * gear**2
    return lost
