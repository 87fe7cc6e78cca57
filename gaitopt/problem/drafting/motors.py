"""Position servos in place of motors: what a robot that is built with servos has instead."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from gaitopt.problem.drafting.faults import Faults
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
    "more where the timestep needs it; critically damped"
)


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
    said = []
    for section in root.findall("actuator"):
        for element in section:
            name = element.get("name", "")
            index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
            if index >= 0 and is_motor(model, index):
                text = _replace(element, model, index, faults)
                said += [f"{name}: {text}"] if text else []
    return [f"position servos from motors ({_ASSUMPTION}): {', '.join(said)}"] if said else []


def _replace(element: ET.Element, model: mujoco.MjModel, index: int, faults: Faults) -> str:
    """Turn a motor's element into a position servo's; return its figures in words."""
    name, joint = element.get("name", ""), servo_joint(model, index)
    torque = _largest_torque(model, index)
    if joint < 0 or not math.isfinite(torque) or torque <= 0.0:
        what = "turns no single joint" if joint < 0 else "has no largest torque"
        faults.add(f"motor {name} {what}", 'write a <position kp="…" forcerange="…"> servo by hand')
        return ""
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
    """Return a motor's largest force before its gear; inf without a limit."""
    gain, largest = abs(float(model.actuator_gainprm[index, 0])), math.inf
    if model.actuator_ctrllimited[index]:
        largest = gain * float(np.abs(model.actuator_ctrlrange[index]).max())
    if model.actuator_forcelimited[index]:
        largest = min(largest, float(np.abs(model.actuator_forcerange[index]).max()))
    return largest


def _travel(model: mujoco.MjModel, joint: int) -> tuple[float, float]:
    """Return the ends of a joint's travel, rad, assumed where it has none."""
    if not model.jnt_limited[joint]:
        return -ASSUMED_RANGE_RAD, ASSUMED_RANGE_RAD
    low, high = model.jnt_range[joint].tolist()
    return low, high
