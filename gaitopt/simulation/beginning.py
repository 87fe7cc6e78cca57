"""Where a rollout begins: at measured joint angles at rest, under what the servos held before."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import unknown_name
from gaitopt.effects.added import is_added, owner_of, with_added
from gaitopt.gait.drive import Drive
from gaitopt.problem.instruments import scalar_joints
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets
from gaitopt.robot.tree import free_joint, robot_bodies, trunk

Array = NDArray[np.float64]

_FAR_RAD = 0.25
"""A servo at rest is closer than this to the target that it holds, rad: more than load and friction make."""

_OFF_RAD = 0.09
"""A servo that rests this close to its start target holds it, rad: trim, load and friction put it off by 5
degrees. The first step of a log may be smaller than that, and is then no sign of what was held before.
"""

_MEASURED = 1e-4
"""How far a measured joint moves to meet a constraint, compared with another joint."""

_NEAR_M = 1.0
"""A robot that is further than this from the world does not stand on it, m."""

_ITERATIONS = 20

_CLOSED = 1e-10
"""Residual of the equality constraints that counts as none, rad or m."""


def held_before(problem: Problem, drive: Drive, model: mujoco.MjModel) -> Array:
    """Return the targets that the servos hold before a drive's gait time 0, rad, shape (nu,).

    They are the problem's start targets. A servo whose joint was measured away from there holds the drive's
    first target instead, where that is nearer to the measured angle, and holds the measured angle where both
    are far from it. A servo whose first target is NaN is unpowered before, too.
    """
    held = start_targets(problem)
    if drive.start is None:
        return held
    first = drive.targets(np.zeros(1))[0]
    for index, joint in enumerate(_driven_joints(model, len(held))):
        if np.isnan(first[index]):
            held[index] = np.nan
        elif joint is not None and joint in drive.start:
            at = drive.start[joint]
            if abs(held[index] - at) <= _OFF_RAD:
                continue
            near = min(held[index], first[index], key=lambda target: abs(target - at))
            held[index] = near if abs(near - at) <= _FAR_RAD else at
    return held


def started_pose(model: mujoco.MjModel, start: Mapping[str, float], pose: Array) -> Array:
    """Return a pose in which some joints have measured angles, and the equality constraints hold.

    Other joints move as little as the constraints need. A robot that stands on the ground is raised or
    lowered until it touches it as it did in the given pose. Free play of a servo whose robot is fixed or held
    is taken up by the load: the rotor rests where it carries the link.

    Args:
        model: the robot, with the parts that effects added.
        start: the measured angles, rad by joint.
        pose: the pose at the problem's start, shape (nq,).

    Raises:
        GaitoptError: the robot has no such joint.
    """
    joints = {model.joint(i).name: i for i in scalar_joints(model)}
    started = np.array(pose)
    for name, angle in start.items():
        if name not in joints:
            raise unknown_name("the start of a drive", "joint", name, joints)
        started[model.jnt_qposadr[joints[name]]] = angle
    started = with_added(started, model)
    if model.neq:
        measured = [int(model.jnt_dofadr[joints[name]]) for name in start]
        started = with_added(_closed(model, started, measured), model)
    if free_joint(model, trunk(model)) is not None:
        return _on_the_ground(model, started, pose)
    return _with_play_taken_up(model, started)


def _driven_joints(model: mujoco.MjModel, count: int) -> list[str | None]:
    """Return the robot's joint that each of the first actuators turns; None for another transmission."""
    joint = int(mujoco.mjtTrn.mjTRN_JOINT)
    found: list[str | None] = []
    for index in range(count):
        turns = int(model.actuator_trntype[index]) == joint
        name = model.joint(int(model.actuator_trnid[index, 0])).name if turns else None
        found.append(owner_of(name) if name is not None and is_added(name) else name)
    return found


def _closed(model: mujoco.MjModel, pose: Array, measured: Sequence[int]) -> Array:
    """Return a pose that meets the equality constraints, the measured degrees of freedom almost unmoved.

    Each Gauss-Newton step is the smallest change that meets the linearised constraints. Two measured joints
    that contradict each other share what is left.
    """
    model = copy.copy(model)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    weights = np.ones(model.nv)
    weights[list(measured)] = _MEASURED
    change = np.empty(model.nv)
    for _ in range(_ITERATIONS):
        mujoco.mj_fwdPosition(model, data)
        equality = np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        apart = data.efc_pos[equality]
        if np.abs(apart).max(initial=0.0) < _CLOSED:
            break
        jacobian = data.efc_J.reshape(-1, model.nv)[equality] * weights
        change[:] = weights * np.linalg.lstsq(jacobian, -apart, rcond=1e-12)[0]
        mujoco.mj_integratePos(model, data.qpos, change, 1.0)
    return np.array(data.qpos)


def _with_play_taken_up(model: mujoco.MjModel, pose: Array) -> Array:
    """Return a pose in which each link with free play rests on its rotor, on the side of its load at rest."""
    rotors = [joint for joint in range(model.njnt) if is_added(model.joint(joint).name)]
    taken = np.array(pose)
    if not rotors:
        return taken
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    loads = data.qfrc_passive - data.qfrc_bias
    for joint in rotors:
        name = model.joint(joint).name
        load = float(loads[model.joint(owner_of(name)).dofadr[0]])
        taken[model.jnt_qposadr[joint]] -= np.sign(load) * model.tendon_range[model.tendon(name).id, 1]
    return taken


def _on_the_ground(model: mujoco.MjModel, pose: Array, before: Array) -> Array:
    """Return a pose in which a free robot is as close to what it stands on as in the pose before."""
    apart = _clearance(model, before), _clearance(model, pose)
    if not np.isfinite(apart).all():
        return pose
    up = -model.opt.gravity / (np.linalg.norm(model.opt.gravity) or 1.0)
    moved = np.array(pose)
    joint = free_joint(model, trunk(model))
    place = 0 if joint is None else int(model.jnt_qposadr[joint])
    moved[place : place + 3] += (apart[0] - apart[1]) * up
    return moved


def _clearance(model: mujoco.MjModel, pose: Array) -> float:
    """Return the distance of a robot in a pose from what is around it, m, negative inside; inf if far."""
    model = copy.copy(model)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_OVERRIDE
    model.opt.o_margin = _NEAR_M
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_fwdPosition(model, data)
    own = robot_bodies(model)[model.geom_bodyid[data.contact.geom]]
    return float(data.contact.dist[own.any(axis=-1) & ~own.all(axis=-1)].min(initial=np.inf))
