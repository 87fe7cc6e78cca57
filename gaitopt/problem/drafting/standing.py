"""How a robot stands: its start targets, the pose in which it rests under them, and what touches then."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.problem.drafting.faults import Faults
from gaitopt.problem.drafting.motors import is_servo
from gaitopt.problem.start import held_activation
from gaitopt.robot.contact import can_touch
from gaitopt.robot.tree import (
    driven_joints,
    every_driven_joint,
    free_joint,
    in_water,
    robot_bodies,
    surroundings,
    trunk,
)

Array = NDArray[np.float64]

STANCES = ("home", "stand", "standing", "start", "rest", "neutral")
"""Names of the keyframe in which a robot stands, the first that a file has."""

_HOLD_S = 6.0
"""Time in which a robot comes to rest, s."""

_SWING_S = 0.5
"""Time in which a servo swings to an end of its range, s."""

_CHUNK_S = 0.1

_REST_SPEED = 1e-3
"""Fastest joint at rest, rad/s or m/s."""

_NEAR = 0.01
"""A geom this close to the ground touches it, as a share of the robot's size: a foot that bounces, or stands
a hair too high."""

FALLEN_RAD = math.radians(60.0)
"""Tilt of the trunk beyond which a robot has fallen over, rad."""

_FALLEN = 5.0
"""A robot that has sunk by this many times its size has no ground under it."""


@dataclass(frozen=True)
class Standing:
    """How a robot stands.

    Attributes:
        targets: start targets, rad, shape (nu,).
        origin: where they come from.
        drawn: the robot as it is drawn, or in the keyframe.
        rested: the robot at rest under its targets.
        touching: geoms of the robot that touch something at rest.
        swinging: geoms that touch something while one servo after another goes through its range; empty where
            the trunk does not lie on the ground.
    """

    targets: Array
    origin: str
    drawn: mujoco.MjData
    rested: mujoco.MjData
    touching: frozenset[int]
    swinging: frozenset[int]


def tilt_of(model: mujoco.MjModel, standing: Standing, up: Array) -> float:
    """Return by how much the trunk at rest is tilted from how it is drawn, rad."""
    body = trunk(model)
    drawn, rested = (data.xmat[body].reshape(3, 3) for data in (standing.drawn, standing.rested))
    return math.acos(float(np.clip(up @ rested @ drawn.T @ up, -1.0, 1.0)))


def stance_key(model: mujoco.MjModel) -> int | None:
    """Return the keyframe in which the robot stands, by its name or else the first; None without any."""
    names = [model.key(i).name.lower() for i in range(model.nkey)]
    named = [names.index(name) for name in STANCES if name in names]
    return (named or [0])[0] if model.nkey else None


def stand(model: mujoco.MjModel, faults: Faults) -> Standing:
    """Let a robot come to rest under its start targets, and look at what touches.

    Args:
        model: the robot; every actuator is a position servo.
        faults: where it is noted that the robot cannot be simulated, or has no ground.
    """
    model = copy.copy(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    targets, origin, drawn = _stance(model)
    rested = copy.copy(drawn)
    rested.ctrl[:] = targets
    if model.na:
        rested.act[:] = held_activation(model, targets, rested.act)
    size = size_of(model, drawn)
    if _hold(model, rested, _HOLD_S):
        _say_diverged(model, rested, faults)
        check_ground(model, faults)
        return Standing(targets, origin, drawn, drawn, frozenset(), frozenset())
    _check_fall(model, drawn, rested, size, faults)
    touching = _touching(model, rested, _NEAR * size)
    lies = any(int(model.geom_bodyid[geom]) == trunk(model) for geom in touching)
    swinging = _swing(model, rested, targets, _NEAR * size) if lies else frozenset()
    return Standing(targets, origin, drawn, rested, touching, swinging)


def size_of(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the largest extent of a robot's geoms, m."""
    own = np.flatnonzero(robot_bodies(model)[model.geom_bodyid])
    if not len(own):
        return float(model.stat.extent)
    reach = model.geom_rbound[own, None]
    return float(
        ((data.geom_xpos[own] + reach).max(axis=0) - (data.geom_xpos[own] - reach).min(axis=0)).max()
    )


def _stance(model: mujoco.MjModel) -> tuple[Array, str, mujoco.MjData]:
    """Return the start targets, where they come from, and the robot as it is drawn."""
    data, key = mujoco.MjData(model), stance_key(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    lengths = np.array(data.actuator_length)
    origin = "the pose in which the MJCF draws the robot"
    targets = lengths
    if key is not None:
        origin = f"the keyframe {model.key(key).name or key!r}"
        targets = np.array(model.key_ctrl[key]) if model.key_ctrl[key].any() else lengths
    limited = model.actuator_ctrllimited.astype(bool)
    inside = np.clip(targets, model.actuator_ctrlrange[:, 0], model.actuator_ctrlrange[:, 1])
    targets = np.where(limited, inside, targets)
    for actuator in range(model.nu):
        low, high = joint_travel(model, actuator)
        targets[actuator] = min(max(targets[actuator], low), high)
    return targets, origin, data


def joint_travel(model: mujoco.MjModel, actuator: int) -> tuple[float, float]:
    """Return the lengths of an actuator between the limits of the joints that it turns; infinite without."""
    low, high = 0.0, 0.0
    joints = driven_joints(model, actuator)
    if not joints or not all(model.jnt_limited[joint] for joint in joints):
        return -np.inf, np.inf
    for joint, share in joints.items():
        ends = sorted((share * model.jnt_range[joint]).tolist())
        low, high = low + ends[0], high + ends[1]
    return low, high


def _hold(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> bool:
    """Simulate until the robot rests, or for a time; return whether the simulation diverged."""
    steps = max(1, round(_CHUNK_S / model.opt.timestep))
    dofs = np.flatnonzero(robot_bodies(model)[model.dof_bodyid])
    for _ in range(max(1, round(seconds / _CHUNK_S))):
        try:
            mujoco.mj_step(model, data, steps)
        except mujoco.FatalError:
            return True
        if data.warning.number.any():
            return True
        if np.abs(data.qvel[dofs]).max(initial=0.0) < _REST_SPEED:
            break
    return False


def _say_diverged(model: mujoco.MjModel, data: mujoco.MjData, faults: Faults) -> None:
    """Note that the simulation diverges, and the joints that are the likely cause."""
    hinges = [j for j in range(model.njnt) if int(model.jnt_type[j]) >= int(mujoco.mjtJoint.mjJNT_SLIDE)]
    dofs = {j: int(model.jnt_dofadr[j]) for j in hinges}
    kv = every_driven_joint(model, np.flatnonzero(model.actuator_biasprm[: model.nu, 2]).tolist())
    bare = [
        str(model.joint(j).name)
        for j, dof in dofs.items()
        if not model.dof_armature[dof] and not model.dof_damping[dof] and j not in kv
    ]
    names = ", ".join(bare) if bare else "the joints"
    faults.add(
        "held at its start targets, the simulation diverges",
        f"add armature and damping to {names}, for servos of 9 g about "
        '<default><joint armature="1e-4" damping="0.02"/></default>, lower kp, or take a smaller timestep',
    )


def check_ground(model: mujoco.MjModel, faults: Faults) -> None:
    """Note that a robot with a free trunk and weight has nothing around it that can carry it."""
    free = free_joint(model, trunk(model)) is not None
    if free and model.opt.gravity.any() and not in_water(model):
        _check_carried(model, faults)


def _check_fall(
    model: mujoco.MjModel, drawn: mujoco.MjData, rested: mujoco.MjData, size: float, faults: Faults
) -> None:
    """Note that a robot falls for ever."""
    gravity = np.array(model.opt.gravity)
    weight = float(np.linalg.norm(gravity))
    body = trunk(model)
    if not weight or (rested.xpos[body] - drawn.xpos[body]) @ gravity / weight < _FALLEN * size:
        return
    if _check_carried(model, faults):
        faults.add("the robot falls past the ground", "draw it above the ground, and the ground larger")


def _check_carried(model: mujoco.MjModel, faults: Faults) -> bool:
    """Note that nothing around a robot can carry it; return whether something can."""
    around = surroundings(model)
    own = np.flatnonzero(robot_bodies(model)[model.geom_bodyid]).tolist()
    if not any(model.geom_contype[geom] or model.geom_conaffinity[geom] for geom in around):
        remedy = 'add <geom name="floor" type="plane" size="5 5 0.1"/> to the worldbody, below the robot'
        faults.add("there is no ground, and the robot falls for ever", remedy)
    elif not any(can_touch(model, geom, other) for geom in own for other in around):
        faults.add(
            "the robot falls through the ground, as none of its geoms collides with it",
            'give its feet contype="1" and the ground conaffinity="1"',
        )
    else:
        return True
    return False


def _touching(model: mujoco.MjModel, data: mujoco.MjData, near: float) -> frozenset[int]:
    """Return the robot's geoms that are closer than this to something that stands still, m."""
    wider = copy.copy(model)
    wider.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_OVERRIDE
    wider.opt.o_margin = near + 2.0 * float(model.geom_margin.max(initial=0.0))
    looked = mujoco.MjData(wider)
    looked.qpos[:] = data.qpos
    mujoco.mj_fwdPosition(wider, looked)
    own = robot_bodies(model)[model.geom_bodyid]
    fixed = (model.body_weldid[model.geom_bodyid] == 0) & ~own
    pairs = looked.contact.geom.reshape(-1, 2)
    mixed = own[pairs].any(axis=1) & fixed[pairs].any(axis=1)
    return frozenset(int(geom) for geom in np.unique(pairs[mixed]) if own[geom])


def _swing(model: mujoco.MjModel, rested: mujoco.MjData, targets: Array, near: float) -> frozenset[int]:
    """Return the geoms that touch while each servo in turn goes to the ends of its range."""
    found: frozenset[int] = frozenset()
    for actuator in range(model.nu):
        if not is_servo(model, actuator):
            continue
        for end in ends_of(model, actuator):
            data = copy.copy(rested)
            data.ctrl[:] = targets
            data.ctrl[actuator] = end
            if not _hold(model, data, _SWING_S):
                found |= _touching(model, data, near)
    return found


def ends_of(model: mujoco.MjModel, actuator: int) -> Sequence[float]:
    """Return the ends of what an actuator may be told, rad; empty where nothing limits it."""
    if model.actuator_ctrllimited[actuator]:
        ends: list[float] = model.actuator_ctrlrange[actuator].tolist()
        return ends
    travel = joint_travel(model, actuator)
    return travel if np.isfinite(travel).all() else ()
