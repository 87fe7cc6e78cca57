"""Actuators that effects add beside a servo: each sees the servo's command and adds a limited torque."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import added_name, is_added, owner_of


def add_drive(spec: mujoco.MjSpec, servo: mujoco.MjsActuator, what: str) -> None:
    """Add an actuator beside a servo; the servo's torque is then measured at its joint.

    Args:
        spec: the specification, before it is compiled.
        servo: the servo.
        what: what the actuator stands for.
    """
    spec.add_actuator(
        name=added_name(what, servo.name),
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


def drive_of(model: mujoco.MjModel, servo: int, what: str) -> int:
    """Return the id of the actuator that `add_drive` added, which then sees commands as late as the servo."""
    drive = int(model.actuator(added_name(what, model.actuator(servo).name)).id)
    for field in (model.actuator_dyntype, model.actuator_dynprm, model.actuator_actearly):
        field[drive] = field[servo]
    return drive


def net_torque_limits(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return each actuator's upper torque limit with the actuators beside it, N m, shape (nu,).

    Where the error is large, each of these gives the limit on the side of its gain.
    """
    limits = np.array(model.actuator_forcerange[:, 1])
    for i in range(model.nu):
        name = model.actuator(i).name
        if is_added(name) and model.actuator_forcelimited[i]:
            side = int(model.actuator_gainprm[i, 0] > 0.0)
            limits[model.actuator(owner_of(name)).id] += model.actuator_forcerange[i, side]
    return limits
