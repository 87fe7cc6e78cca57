"""Dry friction of a servo's motor and gear: constant, in proportion to its torque, and near standstill.

All three set MuJoCo's `frictionloss` of the driven joint, the two that vary while the model runs. So they add
up, hold a joint without creep at any inertia, and stay when the servo loses its power.

MuJoCo's own friction that falls with speed is the LuGre state of a passive `dcmotor`. It is not used here:
its bristles need a stiffness and a damping for each inertia, and friction that is all excess near standstill
leaves them no Coulomb friction to relax to. With steps of 1 and 2 ms, wheels of 1e-5 to 1e-3 kg m^2 then do
not hold, or fly off. An actuator is also what loses its torque with the power. Against steps of 0.1 ms, the
loop below differs by 0.002 rad RMS in stick and slip of a servo of 2.7 N m, and by 0.0006 rad in its steps.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import added_name
from gaitopt.effects.effect import Effect, Update
from gaitopt.effects.library.dry_friction import stiffen_friction, varied_friction
from gaitopt.effects.library.servo import torque_scale
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

STRIBECK_RAD_S = 0.1
"""Speed at which the excess of friction near standstill has fallen to 1/e, rad/s, at the output shaft.

Friction models that Rhoban (BAM, "Extended Friction Models for the Physics Simulation of Servo Actuators",
2024) and others fit to Dynamixel and Feetech servos have speeds of this order.
"""


def _friction(parts: Parts) -> float:
    """Return the largest dry friction of the driven joints, N m."""
    return float(parts.model.dof_frictionloss[parts.servo_dofs].max(initial=0.0))


def _set_friction(parts: Parts, torque: float, nominal: float) -> None:
    """Set the dry friction; servos of different friction keep their proportion."""
    dofs = parts.servo_dofs
    if nominal > 0.0:
        parts.model.dof_frictionloss[dofs] *= torque / nominal
    else:
        parts.model.dof_frictionloss[dofs] = torque
    stiffen_friction(parts.model, dofs)


SERVO_FRICTION = Effect(
    name="servo_friction",
    summary="dry friction of motor and gear, on the driven joint",
    parameter="torque_n_m",
    unit="N m",
    neutral=_friction,
    low=0.0,
    high=0.6,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.08,
        "Coulomb friction identified on Dynamixel and Feetech servos (Rhoban's BAM): 2 to 6 % of the stall "
        "torque; small plastic gears with more stages and dry bushes have more",
    ),
    reference=torque_scale,
    reference_name="the nominal torque limit",
    allowed=(0.0, math.inf),
    target="any",
    on_joints=True,
    model=_set_friction,
)


def _sense(what: str, sensor: mujoco.mjtSensor, spec: mujoco.MjSpec, nominal: Parts) -> None:
    """Add a sensor of each target servo's joint; behind free play, of its rotor."""
    for index in nominal.servos:
        servo = spec.actuators[index]
        joint = mujoco.mjtObj.mjOBJ_JOINT
        spec.add_sensor(name=added_name(what, servo.name), type=sensor, objtype=joint, objname=servo.target)


def _sensed(what: str, parts: Parts) -> dict[int, int]:
    """Return where ``sensordata`` has a sensor of `_sense`, by degree of freedom."""
    names = [added_name(what, parts.channels[i]) for i in parts.servos]
    addresses = (int(parts.model.sensor(name).adr[0]) for name in names)
    return dict(zip(parts.servo_dofs, addresses, strict=True))


def _stiffen(parts: Parts, _: float, __: float) -> None:
    stiffen_friction(parts.model, parts.servo_dofs)


def _sense_torque(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    _sense("transmitted", mujoco.mjtSensor.mjSENS_JOINTACTFRC, spec, nominal)


def _loaded(parts: Parts, share: float) -> Update:
    """Return the loop that adds a share of the torque of all actuators of the joint, a step before.

    A torque that jumps counts at once: ArcFold's joints move by what is left of it in that very step. The
    loop needs no smoothing: friction does not change the torque of a servo at once, only through its motion.
    """
    sensed_by_dof = _sensed("transmitted", parts)
    addresses = list(sensed_by_dof.values())
    set_part = varied_friction(parts.model, list(sensed_by_dof))

    def update(sensed: NDArray[np.float64]) -> None:
        set_part([share * abs(sensed.item(address)) for address in addresses])

    return Update(update, prompt=True)


SERVO_FRICTION_LOAD = Effect(
    name="servo_friction_load",
    summary="dry friction of the gear that is a share of the torque that the servo transmits",
    parameter="share",
    unit="",
    neutral=0.0,
    low=0.0,
    high=0.8,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.15,
        "load-dependent friction identified on Dynamixel and Feetech servos (Rhoban's BAM): 5 to 20 % of the "
        "torque; three to five spur stages of 90 to 97 % each lose as much",
    ),
    allowed=(0.0, 0.95),
    target="any",
    on_joints=True,
    structure=_sense_torque,
    model=_stiffen,
    loop=_loaded,
)


def _sense_speed(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    _sense("speed", mujoco.mjtSensor.mjSENS_JOINTVEL, spec, nominal)


def _stick(parts: Parts, torque: float) -> Update:
    """Return the loop that adds torque exp(-(v / v_s)^2) at speed v."""
    sensed_by_dof = _sensed("speed", parts)
    addresses = list(sensed_by_dof.values())
    set_part = varied_friction(parts.model, list(sensed_by_dof))
    set_part([torque] * len(addresses))

    def update(sensed: NDArray[np.float64]) -> None:
        relative = [sensed.item(address) / STRIBECK_RAD_S for address in addresses]
        set_part([torque * math.exp(-v * v) for v in relative])

    return Update(update)


SERVO_STICTION = Effect(
    name="servo_stiction",
    summary=f"what dry friction is more near standstill; it has fallen to 1/e at {STRIBECK_RAD_S:g} rad/s",
    parameter="torque_n_m",
    unit="N m",
    neutral=0.0,
    low=0.0,
    high=0.4,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.04,
        "break-away torques of Dynamixel and Feetech servos (Rhoban's BAM) and of greased plastic gears: up "
        "to twice the friction in motion, which is 2 to 6 % of the stall torque",
    ),
    reference=torque_scale,
    reference_name="the nominal torque limit",
    allowed=(0.0, math.inf),
    target="any",
    on_joints=True,
    structure=_sense_speed,
    model=_stiffen,
    loop=_stick,
)
