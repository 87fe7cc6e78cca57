"""The dead band: errors of angle that a servo ignores."""

from __future__ import annotations

import mujoco

from gaitopt.effects.added import added_name
from gaitopt.effects.effect import Effect
from gaitopt.effects.library.servo import drives_no_joint
from gaitopt.effects.library.servo_drives import add_drive, drive_of
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


def _add_opposition(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add to each servo an actuator that cancels its torque while its error is small.

    kp clip(e, -d, d) subtracted from kp e leaves kp (e - d) outside the band and nothing inside. The
    servo's torque is then measured at the joint. It sees the error through the servo's own lag.
    """
    for index in nominal.servos:
        add_drive(spec, spec.actuators[index], "dead_band")


def _oppose(parts: Parts, half_width: float, _: float) -> None:
    """Set the band; a servo with a torque limit may use it all beyond the band."""
    model = parts.model
    for servo in parts.servos:
        opposed = drive_of(model, servo, "dead_band")
        gain, bias = model.actuator_gainprm[servo, 0], model.actuator_biasprm[servo]
        model.actuator_gainprm[opposed, 0] = -gain
        model.actuator_biasprm[opposed, :2] = -bias[:2]
        band = gain * half_width
        model.actuator_forcerange[opposed] = -band, band
        if model.actuator_forcelimited[servo]:
            model.actuator_forcerange[servo] += (-band, band)


SERVO_DEADBAND = Effect(
    name="servo_deadband",
    summary="no torque while the error is smaller than this; beyond it, torque grows from zero",
    parameter="half_width_rad",
    unit="rad",
    neutral=0.0,
    low=0.0,
    high=0.1,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.015,
        "datasheets of 9 g servos: a dead band of 4 to 10 us of pulse, where 2000 us are 180 degrees",
    ),
    allowed=(0.0, 1.0),
    target="any",
    missing=drives_no_joint,
    structure=_add_opposition,
    model=_oppose,
)


def half_width(model: mujoco.MjModel, servo: int) -> float:
    """Return half the width of a servo's dead band, in the unit of its command; 0 without."""
    names = [model.actuator(i).name for i in range(model.nu)]
    name = added_name("dead_band", names[servo])
    if name not in names:
        return 0.0
    return float(model.actuator_forcerange[names.index(name), 1] / model.actuator_gainprm[servo, 0])
