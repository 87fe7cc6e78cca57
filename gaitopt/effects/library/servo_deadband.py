"""The dead band: errors of angle that a servo ignores."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import added_name, owner_of
from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


def _add_opposition(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add to each servo an actuator that cancels its torque while its error is small.

    kp clip(e, -d, d) subtracted from kp e leaves kp (e - d) outside the band and nothing inside. The
    servo's torque is then measured at the joint. It sees the error through the servo's own lag.
    """
    for index in nominal.servos:
        servo = spec.actuators[index]
        spec.add_actuator(
            name=added_name("dead_band", servo.name),
            trntype=servo.trntype,
            target=servo.target,
            gear=servo.gear,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            forcerange=[-1.0, 1.0],
            dyntype=servo.dyntype,
            dynprm=servo.dynprm,
            actearly=servo.actearly,
        )
        for sensor in spec.sensors:
            if sensor.type == mujoco.mjtSensor.mjSENS_ACTUATORFRC and sensor.objname == servo.name:
                sensor.type = mujoco.mjtSensor.mjSENS_JOINTACTFRC
                sensor.objtype = mujoco.mjtObj.mjOBJ_JOINT
                sensor.objname = servo.target


def _oppose(parts: Parts, half_width: float, _: float) -> None:
    """Set the band; a servo with a torque limit may use it all beyond the band."""
    model = parts.model
    for servo in parts.servos:
        opposed = model.actuator(added_name("dead_band", model.actuator(servo).name)).id
        model.actuator_dyntype[opposed] = model.actuator_dyntype[servo]
        model.actuator_dynprm[opposed] = model.actuator_dynprm[servo]
        model.actuator_actearly[opposed] = model.actuator_actearly[servo]
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
    on_joints=True,
    structure=_add_opposition,
    model=_oppose,
)


def net_torque_limits(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return each actuator's upper torque limit less what a dead band cancels of it, N m, shape (nu,)."""
    limits = np.array(model.actuator_forcerange[:, 1])
    for i in range(model.nu):
        name = model.actuator(i).name
        if name == added_name("dead_band", owner_of(name)):
            limits[model.actuator(owner_of(name)).id] -= limits[i]
    return limits
