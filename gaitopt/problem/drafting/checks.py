"""What a student's first MJCF often has wrong, found before it is simulated."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from gaitopt.problem.drafting.faults import Faults
from gaitopt.problem.drafting.motors import is_motor, is_servo
from gaitopt.problem.drafting.standing import FALLEN_RAD, Standing, ends_of, size_of, tilt_of
from gaitopt.robot.tree import driven_joints, robot_bodies

_MOST_RAD = 4.0 * math.pi
"""A servo's or joint's travel beyond this is in degrees, and was read as rad."""

_LEAST_RAD = math.radians(4.0)
"""Where all joints travel less than this, their ranges are in rad, and were read as degrees."""

_SMALL_M, _LARGE_M = 0.01, 5.0
"""Robots smaller or larger than this are rare; units may be wrong."""


def check_actuators(model: mujoco.MjModel, faults: Faults, from_motors: bool) -> None:
    """Note actuators that are no position servos of joints."""
    if not model.nu:
        faults.add(
            "no actuators", 'a gait needs position servos: <actuator><position joint="…" kp="…"/></actuator>'
        )
    names = [str(model.actuator(i).name) for i in range(model.nu)]
    motors = [i for i in range(model.nu) if is_motor(model, i)]
    if motors and not from_motors:
        faults.add(
            f"{_listed([names[i] for i in motors])}: motors, not position servos",
            "--from-motors makes position servos of them, from gear and range",
        )
    others = [i for i in range(model.nu) if i not in motors and not is_servo(model, i)]
    if others:
        faults.add(
            f"{_listed([names[i] for i in others])}: not a position servo",
            'write <position joint="…" kp="…"/>, which turns a joint to an angle',
        )
    pulling = [i for i in range(model.nu) if i not in others and not driven_joints(model, i)]
    if pulling:
        faults.add(
            f"{_listed([names[i] for i in pulling])}: pulls at no hinge or slide, so its target is no angle",
            'let it turn a joint, or a <fixed> tendon over joints: <position joint="…"/>',
        )


def check_angles(model: mujoco.MjModel, faults: Faults) -> None:
    """Note angles that seem to be in the wrong unit."""
    hinges = [j for j in range(model.njnt) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)]
    limited = [j for j in hinges if model.jnt_limited[j]]
    wide = [str(model.joint(j).name) for j in limited if np.ptp(model.jnt_range[j]) > _MOST_RAD]
    if wide:
        faults.add(
            f"{_listed(wide)}: a range of more than two turns",
            'ranges in degrees need <compiler angle="degree"/>, which is the default',
        )
    if limited and all(np.ptp(model.jnt_range[j]) < _LEAST_RAD for j in limited):
        faults.add(
            "all joints have ranges of less than 4 degrees", 'ranges in rad need <compiler angle="radian"/>'
        )
    far = [
        str(model.actuator(i).name)
        for i in range(model.nu)
        if is_servo(model, i)
        and model.actuator_ctrllimited[i]
        and np.ptp(model.actuator_ctrlrange[i]) > _MOST_RAD
    ]
    if far:
        faults.add(
            f"{_listed(far)}: a ctrlrange of more than two turns",
            "write it in rad: MuJoCo reads ctrlrange in rad whatever the compiler's angle",
        )


def remarks_on(model: mujoco.MjModel, standing: Standing, up: Sequence[float]) -> list[str]:
    """Return what a user should look at before anything is searched."""
    said = []
    tilt = tilt_of(model, standing, np.array(up))
    if tilt > FALLEN_RAD:
        said.append(
            f"it falls over: at rest under the start targets the trunk is tilted by {math.degrees(tilt):.0f} "
            "degrees; correct [start] ctrl_deg, or give the MJCF a keyframe in which it stands"
        )
    size = size_of(model, standing.drawn)
    mass = float(model.body_mass[robot_bodies(model)].sum())
    if not _SMALL_M < size < _LARGE_M:
        said.append(f"it is {size:.3g} m large and weighs {mass:.3g} kg: are its lengths in metres?")
    unlimited = [i for i in range(model.nu) if not model.actuator_forcelimited[i]]
    if unlimited:
        said.append(
            f"{_listed([str(model.actuator(i).name) for i in unlimited])} have no torque limit "
            '(forcerange="-0.2 0.2" for a servo of 9 g)'
        )
    endless = [str(model.actuator(i).name) for i in range(model.nu) if not len(ends_of(model, i))]
    if endless:
        said.append(f"{_listed(endless)} have no range, nor have their joints: 45 degrees to either side")
    return said


def _listed(names: Sequence[str]) -> str:
    """Return names, or the first and how many more."""
    return ", ".join(names) if len(names) <= 4 else f"{', '.join(names[:3])} and {len(names) - 3} more"
