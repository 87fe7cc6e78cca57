"""Punch: the least torque with which a servo drives once its error leaves the dead band."""

from __future__ import annotations

import math

import mujoco

from gaitopt.effects.effect import Effect
from gaitopt.effects.library.servo import drives_no_joint, torque_scale
from gaitopt.effects.library.servo_deadband import half_width
from gaitopt.effects.library.servo_drives import add_drive, drive_of
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_STEEPNESS = 10.0
"""Slope of the rise over the servo's gain. A step would chatter; with ten times the gain, a punch as large as
the torque of 2 degrees of error is reached within 0.2 degrees."""

_SIGNS = {"punch_up": 1.0, "punch_down": -1.0}


def _add_drives(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add to each servo an actuator for either direction."""
    for index in nominal.servos:
        for what in _SIGNS:
            add_drive(spec, spec.actuators[index], what)


def _punch(parts: Parts, torque: float, _: float) -> None:
    """Set the torque beyond the dead band; all torque together stays within the servo's limit."""
    model = parts.model
    for servo in parts.servos:
        width = half_width(model, servo)
        gain, bias = _STEEPNESS * model.actuator_gainprm[servo, 0], _STEEPNESS * model.actuator_biasprm[servo]
        if model.actuator_forcelimited[servo]:
            low, high = model.actuator_forcerange[servo]
            model.actuator_forcerange[servo] = min(low + torque, 0.0), max(high - torque, 0.0)
        for what, sign in _SIGNS.items():
            drive = drive_of(model, servo, what)
            model.actuator_gainprm[drive, 0] = gain
            model.actuator_biasprm[drive, :2] = bias[0] - sign * gain * width, bias[1]
            model.actuator_forcerange[drive] = sorted((0.0, sign * torque))


SERVO_PUNCH = Effect(
    name="servo_punch",
    summary="least torque with which a servo drives as soon as its error leaves the dead band",
    parameter="torque_n_m",
    unit="N m",
    neutral=0.0,
    low=0.0,
    high=0.8,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.25,
        "the pulse stretcher of hobby servos starts with a least pulse that overcomes friction at rest "
        "(data sheets of NE544 and its successors), and Dynamixel's control table has a least current, "
        "'punch'; their size in torque is not published",
    ),
    reference=torque_scale,
    reference_name="the nominal torque limit",
    allowed=(0.0, math.inf),
    target="any",
    missing=drives_no_joint,
    of_bench=True,
    structure=_add_drives,
    model=_punch,
)
