"""Position servos in place of motors: what a robot that is built with servos has instead."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from gaitopt.problem.drafting.faults import Faults, listed
from gaitopt.robot.tree import driven_joints, servo_joint

ASSUMED_RANGE_RAD = math.radians(45.0)
"""Travel to either side where the MJCF limits neither servo nor joint, rad."""

_FULL_TORQUE_AT = 0.05
"""Error at which a servo has its full torque, as a share of its travel: 3 degrees of 60."""

_MOST_PHASE = 0.5
"""Largest natural frequency of a servo with its load, in rad a timestep: beyond 2 it cannot be simulated."""

_KEPT = ("name", "joint", "tendon", "jointinparent", "group")
"""Attributes of a motor that its servo keeps."""

_ASSUMPTION = (
    "assumed: the motor's largest torque is the limit, reached at an error of a twentieth of the travel, or "
    "more where the timestep needs it; critically damped; 45 degrees to either side of a joint without range"
)
_FULL_CONTROL = "without a ctrlrange, the gear is the largest torque"


def is_motor(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator's force is in proportion to its control, whatever the angle."""
    none = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_NONE)
    fixed = int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    return none and fixed and int(model.actuator_dyntype[actuator]) != int(mujoco.mjtDyn.mjDYN_INTEGRATOR)


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator turns toward the angle that it is given."""
    affine = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    integrates = int(model.actuator_dyntype[actuator]) == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
    return affine and bool(model.actuator_biasprm[actuator, 1]) and not integrates


def make_servos(root: ET.Element, model: mujoco.MjModel, faults: Faults) -> list[str]:
    """Replace each motor of an MJCF by a position servo, in place.

    Args:
        root: the MJCF, its includes resolved and its parts named.
        model: the same, compiled.
        faults: where motors are noted that cannot be replaced.

    Returns:
        What was assumed, for each servo.
    """
    motors = {}
    for section in root.findall("actuator"):
        for element in section:
            name = element.get("name", "")
            index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
            if index >= 0 and is_motor(model, index):
                motors[name] = (element, index)
    pulling = [name for name, (_, index) in motors.items() if servo_joint(model, index) < 0]
    torques = {name: _largest_torque(model, index) for name, (_, index) in motors.items()}
    weak = [name for name, torque in torques.items() if not 0.0 < torque < math.inf and name not in pulling]
    if pulling:
        faults.add(
            f"{listed(pulling)}: a motor that turns no single joint",
            'write a <position kp="…" forcerange="…"> servo by hand',
        )
    if weak:
        faults.add(
            f"{listed(weak)}: a motor without largest torque",
            'add it in N m: <default><motor ctrlrange="-0.2 0.2"/></default>, 0.2 for a servo of 9 g',
        )
    figures: dict[str, list[str]] = {}
    for name, (element, index) in motors.items():
        if name not in pulling and name not in weak:
            figures.setdefault(_replace(element, model, index, torques[name]), []).append(name)
    if not figures:
        return []
    unlimited = any(_is_unlimited(model, index) for _, index in motors.values())
    assumed = f"{_ASSUMPTION}; {_FULL_CONTROL}" if unlimited else _ASSUMPTION
    said = "; ".join(f"{listed(names)}: {text}" for text, names in figures.items())
    return [f"position servos from motors ({assumed}): {said}"]


def _replace(element: ET.Element, model: mujoco.MjModel, index: int, torque: float) -> str:
    """Turn a motor's element into a position servo's; return its figures in words."""
    joint = servo_joint(model, index)
    share = driven_joints(model, index)[joint] / float(model.actuator_gear[index, 0])
    low, high = _travel(model, joint)
    ends = sorted((share * low, share * high))
    torque *= abs(float(model.actuator_gear[index, 0]))
    kp = torque / (_FULL_TORQUE_AT * (ends[1] - ends[0]))
    inertia = float(model.dof_M0[model.jnt_dofadr[joint]]) / share**2
    own = float(model.dof_damping[model.jnt_dofadr[joint]]) / share**2
    kp = min(kp, inertia * (_MOST_PHASE / float(model.opt.timestep)) ** 2)
    kv = max(0.0, 2.0 * math.sqrt(kp * inertia) - own)
    kept = {key: value for key, value in element.attrib.items() if key in _KEPT}
    element.tag = "position"
    element.attrib.clear()
    element.attrib.update(kept)
    element.set("kp", f"{kp:.6g}")
    element.set("kv", f"{kv:.6g}")
    element.set("gear", "1")
    element.set("ctrllimited", "true")
    element.set("ctrlrange", f"{ends[0]:.6g} {ends[1]:.6g}")
    element.set("forcelimited", "true")
    element.set("forcerange", f"{-torque:.6g} {torque:.6g}")
    return f"kp {kp:.3g} N m/rad, limit {torque:.3g} N m"


def _largest_torque(model: mujoco.MjModel, index: int) -> float:
    """Return a motor's largest force before its gear; inf without a limit or gear that tells it."""
    gain, largest = abs(float(model.actuator_gainprm[index, 0])), math.inf
    if _is_unlimited(model, index):
        return gain if abs(float(model.actuator_gear[index, 0])) != 1.0 else math.inf
    if model.actuator_ctrllimited[index]:
        largest = gain * float(np.abs(model.actuator_ctrlrange[index]).max())
    if model.actuator_forcelimited[index]:
        largest = min(largest, float(np.abs(model.actuator_forcerange[index]).max()))
    return largest


def _is_unlimited(model: mujoco.MjModel, index: int) -> bool:
    return not model.actuator_ctrllimited[index] and not model.actuator_forcelimited[index]


def _travel(model: mujoco.MjModel, joint: int) -> tuple[float, float]:
    """Return the ends of a joint's travel, rad, assumed where it has none."""
    if not model.jnt_limited[joint]:
        return -ASSUMED_RANGE_RAD, ASSUMED_RANGE_RAD
    low, high = model.jnt_range[joint].tolist()
    return low, high
