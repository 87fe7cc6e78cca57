"""What a student's first MJCF often has wrong, found before it is simulated."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from gaitopt.problem.drafting.faults import Faults, listed
from gaitopt.problem.drafting.motors import is_motor, is_servo
from gaitopt.problem.drafting.standing import FALLEN_RAD, Standing, ends_of, size_of, tilt_of
from gaitopt.problem.mjcf import missing_meshes
from gaitopt.robot.contact import can_touch
from gaitopt.robot.tree import driven_joints, robot_bodies, servo_joint, surroundings

_MOST_RAD = 4.0 * math.pi
"""A servo's or joint's travel beyond this is in degrees, and was read as rad."""

_LEAST_RAD = math.radians(4.0)
"""Where all joints travel less than this, their ranges are in rad, and were read as degrees."""

_SUNKEN = 0.03
"""A part lies deep in the ground beyond this share of the robot's size; a cover may be a little lower."""

_MOST_LOAD = 0.4
"""Largest share of its torque that a servo may need at rest: it needs twice that with half of the feet."""

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
            f"{listed([names[i] for i in motors])}: motors, not position servos",
            "--from-motors makes position servos of them, from gear and range",
        )
    others = [i for i in range(model.nu) if i not in motors and not is_servo(model, i)]
    if others:
        faults.add(
            f"{listed([names[i] for i in others])}: not a position servo",
            'write <position joint="…" kp="…"/>, which turns a joint to an angle',
        )
    pulling = [i for i in range(model.nu) if i not in others and not driven_joints(model, i)]
    if pulling:
        faults.add(
            f"{listed([names[i] for i in pulling])}: pulls at no hinge or slide, so its target is no angle",
            'let it turn a joint, or a <fixed> tendon over joints: <position joint="…"/>',
        )


def check_angles(root: ET.Element, model: mujoco.MjModel, faults: Faults) -> None:
    """Note angles that seem to be in the wrong unit; `model` is the MJCF, compiled."""
    hinges = [j for j in range(model.njnt) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)]
    limited = [j for j in hinges if model.jnt_limited[j]]
    wide = [str(model.joint(j).name) for j in limited if np.ptp(model.jnt_range[j]) > _MOST_RAD]
    if wide:
        faults.add(
            f"{listed(wide)}: a range of more than two turns",
            'ranges in degrees need <compiler angle="degree"/>, which is the default',
        )
    if limited and all(np.ptp(model.jnt_range[j]) < _LEAST_RAD for j in limited):
        turned = {f'euler="{element.get("euler")}"' for element in root.iter() if _in_degrees(element)}
        also = f"; then write {', '.join(sorted(turned))} in rad, too" if turned else ""
        faults.add(
            "all joints have ranges of less than 4 degrees",
            f'ranges in rad need <compiler angle="radian"/>{also}',
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
            f"{listed(far)}: a ctrlrange of more than two turns",
            "write it in rad: MuJoCo reads ctrlrange in rad whatever the compiler's angle",
        )


def _in_degrees(element: ET.Element) -> bool:
    """Return whether an element is turned by more than a whole turn if its angles are in rad."""
    words = element.get("euler", "").split()
    return any(abs(float(word)) > 2.0 * math.pi for word in words)


def replace_missing(root: ET.Element, mjcf: Path) -> dict[str, list[ET.Element]]:
    """Put a small sphere in place of each geom whose mesh file is missing, so that the rest can be read.

    Args:
        root: the MJCF, its includes resolved; edited in place.
        mjcf: where it lies.

    Returns:
        The geoms, by what is missing.
    """
    found = {}
    for file, mesh in missing_meshes(root, mjcf).items():
        name = mesh.get("name") or Path(file).stem
        found[file] = [geom for geom in root.iter("geom") if geom.get("mesh") == name]
        for assets in root.findall("asset"):
            if mesh in assets:
                assets.remove(mesh)
        for geom in found[file]:
            del geom.attrib["mesh"]
            geom.set("type", "sphere")
            geom.set("size", "0.01")
    return found


def leave_out_missing(
    root: ET.Element,
    model: mujoco.MjModel,
    missing: Mapping[str, Sequence[ET.Element]],
    faults: Faults,
) -> list[str]:
    """Leave out the geoms of missing meshes that can touch nothing; note the others.

    Args:
        root: the MJCF, its parts named; edited in place.
        model: the same, compiled.
        missing: what `replace_missing` returned.
        faults: where meshes are noted that must be there.

    Returns:
        What was left out.
    """
    said = []
    for file, geoms in missing.items():
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, geom.get("name", "")) for geom in geoms]
        names = listed([geom.get("name", "") for geom in geoms])
        if any(one < 0 or model.geom_contype[one] or model.geom_conaffinity[one] for one in ids):
            what = "put it beside the MJCF, or take the geom out, or write a box in its place"
            faults.add(f"the mesh file {file} of {names} is missing", what)
            continue
        for parent in list(root.iter()):
            for geom in geoms:
                if geom in parent:
                    parent.remove(geom)
        said.append(
            f"without {names or 'an unused mesh'}, as {file} is missing; nothing touches it, but weigh it"
        )
    return said


def sunken(model: mujoco.MjModel, standing: Standing) -> list[str]:
    """Return the robot's geoms that lie deep in the ground at rest, as they collide with nothing around."""
    around = surroundings(model)
    own = np.flatnonzero(robot_bodies(model)[model.geom_bodyid]).tolist()
    through = [geom for geom in own if not any(can_touch(model, geom, other) for other in around)]
    solid = copy.copy(model)
    for geom in (*through, *around):
        body = int(model.geom_bodyid[geom])
        solid.geom_contype[geom] = solid.geom_conaffinity[geom] = 1
        solid.body_contype[body] |= 1
        solid.body_conaffinity[body] |= 1
    data = mujoco.MjData(solid)
    data.qpos[:] = standing.rested.qpos
    mujoco.mj_fwdPosition(solid, data)
    contacts = data.contact
    deep = contacts.geom[contacts.dist < -_SUNKEN * size_of(model, standing.drawn)]
    found = {int(geom) for geom in deep.ravel()}
    return [str(model.geom(geom).name) for geom in through if geom in found]


def remarks_on(model: mujoco.MjModel, standing: Standing, up: Sequence[float]) -> list[str]:
    """Return what a user should look at before anything is searched."""
    said = []
    tilt = tilt_of(model, standing, np.array(up))
    if tilt > FALLEN_RAD:
        said.append(
            f"it falls over: at rest under the start targets the trunk is tilted by {math.degrees(tilt):.0f} "
            "degrees; correct [start] ctrl_deg, or give the MJCF a keyframe in which it stands"
        )
    through = sunken(model, standing)
    if through:
        said.append(
            f"{listed(through)}: in the ground at rest, as contype and conaffinity stop nothing: write "
            'contype="1" conaffinity="1" for what should touch, there or in its class, and draft again'
        )
    size = size_of(model, standing.drawn)
    mass = float(model.body_mass[robot_bodies(model)].sum())
    if not _SMALL_M < size < _LARGE_M:
        said.append(f"it is {size:.3g} m large and weighs {mass:.3g} kg: are its lengths in metres?")
    said += _overloaded(model, standing, mass)
    unlimited = [i for i in range(model.nu) if not model.actuator_forcelimited[i]]
    if unlimited:
        said.append(
            f"{listed([str(model.actuator(i).name) for i in unlimited])} have no torque limit "
            '(for servos of 9 g <default><position forcerange="-0.2 0.2"/></default>)'
        )
    bare = [str(model.joint(j).name) for j in _bare(model)]
    if bare:
        said.append(
            f"{listed(bare)}: servos on joints without damping have no speed limit (for servos of 9 g "
            '<default><joint damping="0.02" armature="1e-4"/></default>)'
        )
    endless = [str(model.actuator(i).name) for i in range(model.nu) if not len(ends_of(model, i))]
    if endless:
        said.append(f"{listed(endless)} have no range, nor have their joints: 45 degrees to either side")
    return said


def _bare(model: mujoco.MjModel) -> list[int]:
    """Return the hinges without damping that servos with a torque limit turn."""
    limited = [i for i in range(model.nu) if model.actuator_forcelimited[i]]
    joints = {servo_joint(model, i) for i in limited} - {-1}
    return [joint for joint in sorted(joints) if not model.dof_damping[model.jnt_dofadr[joint]]]


def _overloaded(model: mujoco.MjModel, standing: Standing, mass: float) -> list[str]:
    """Return that servos need much of their torque to hold the robot at rest, with what weighs most."""
    limits = model.actuator_forcerange[:, 1]
    limited = (model.actuator_forcelimited != 0) & (limits > 0.0)
    shares = np.abs(standing.rested.actuator_force) / np.where(limited, limits, np.inf)
    weak = np.flatnonzero(shares > _MOST_LOAD)
    if not len(weak):
        return []
    own = np.flatnonzero(robot_bodies(model))
    heaviest = int(own[np.argmax(model.body_mass[own])])
    names, part = listed([str(model.actuator(i).name) for i in weak]), model.body(heaviest)
    return [
        f"{names} take at rest up to {shares.max():.0%} of their torque, and need twice that with half "
        f"of its feet lifted: it weighs {mass:.3g} kg, {part.name} {float(part.mass[0]):.3g} kg of it; give "
        "its geoms their true mass, or the servos their true torque"
    ]
