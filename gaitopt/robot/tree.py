"""The robot in a model: the trees that its actuators move. All else is ground, an obstacle, or lies loose.

``also`` are bodies that belong to the robot because a role of the problem says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

_SCALAR = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)

_WATER = 100.0
"""A fluid denser than this may carry a robot, kg/m^3; air has 1.2."""


def driven_joints(model: mujoco.MjModel, actuator: int) -> dict[int, float]:
    """Return the joints that an actuator turns, each with the change of the actuator's length for 1 rad or m.

    An actuator turns a joint itself, or the joints of a fixed tendon, in proportion to their coefficients.

    Returns:
        Length by joint id; empty for an actuator that pulls at a site, a body, a spatial tendon, or a joint
        of several degrees of freedom.
    """
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    gear = float(model.actuator_gear[actuator, 0])
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        return {target: gear} if int(model.jnt_type[target]) in _SCALAR else {}
    if kind != int(mujoco.mjtTrn.mjTRN_TENDON):
        return {}
    shares: dict[int, float] = {}
    for wrap in _wraps(model, target):
        if int(model.wrap_type[wrap]) != int(mujoco.mjtWrap.mjWRAP_JOINT):
            return {}
        joint = int(model.wrap_objid[wrap])
        shares[joint] = shares.get(joint, 0.0) + gear * float(model.wrap_prm[wrap])
    return {joint: share for joint, share in shares.items() if share != 0.0}


def every_driven_joint(model: mujoco.MjModel, actuators: Iterable[int] | None = None) -> set[int]:
    """Return the joints that any of some actuators turns; of all actuators by default."""
    some = range(model.nu) if actuators is None else actuators
    return {joint for actuator in some for joint in driven_joints(model, actuator)}


def servo_joint(model: mujoco.MjModel, actuator: int) -> int:
    """Return the id of the one joint that an actuator turns, or turns by a tendon; -1 for another number."""
    joints = list(driven_joints(model, actuator))
    return joints[0] if len(joints) == 1 else -1


def trunk(model: mujoco.MjModel, also: Sequence[int] = ()) -> int:
    """Return the id of the body that carries the robot: the root of the heaviest tree that is driven.

    It has the free joint, if there is one. In a model that nothing drives, any tree may be the robot's.
    """
    return max(robot_roots(model, also), key=lambda root: (float(model.body_subtreemass[root]), -root))


def robot_bodies(model: mujoco.MjModel, also: Sequence[int] = ()) -> NDArray[np.bool_]:
    """Return which bodies are the robot's: those of its trees, shape (nbody,).

    Trees that a tendon or an equality constraint ties to a driven tree belong to the robot, too. In a model
    that nothing drives, every body is the robot's.
    """
    roots = _roots(model, also) or {int(root) for root in model.body_rootid[1:]}
    return np.isin(model.body_rootid, sorted(roots))


def robot_roots(model: mujoco.MjModel, also: Sequence[int] = ()) -> list[int]:
    """Return the roots of the robot's trees, those without any geom left out: they are parts of a servo."""
    with_geoms = set(model.body_rootid[model.geom_bodyid].tolist())
    return sorted((_roots(model, also) or set(model.body_rootid[1:].tolist())) & with_geoms) or [1]


def free_joint(model: mujoco.MjModel, body: int) -> int | None:
    """Return the id of the free joint by which a body moves, or None."""
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    return first if count == 1 and int(model.jnt_type[first]) == _FREE else None


def in_water(model: mujoco.MjModel) -> bool:
    """Return whether the robot is in a fluid that may carry it."""
    return bool(model.opt.density > _WATER)


def surroundings(model: mujoco.MjModel, also: Sequence[int] = ()) -> list[int]:
    """Return the ids of the geoms that are not the robot's: the ground, obstacles, and what lies loose."""
    return np.flatnonzero(~robot_bodies(model, also)[model.geom_bodyid]).tolist()


def has_obstacles(model: mujoco.MjModel, also: Sequence[int] = ()) -> bool:
    """Return whether bodies other than the world and the robot have geoms that can be touched."""
    others = ~robot_bodies(model, also)
    others[0] = False
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    return bool((others[model.geom_bodyid] & touchable).any())


def _roots(model: mujoco.MjModel, also: Sequence[int]) -> set[int]:
    """Return the bodies under the world whose trees are driven, or tied to those that are."""
    driven = {root for i in range(model.nu) for root in _pulled(model, i)}
    driven = (driven | {int(model.body_rootid[body]) for body in also}) - {0}
    ties = [_tied_by(model, i) for i in range(model.neq) if model.eq_active0[i]]
    ties += [_held_by(model, i) for i in range(model.ntendon)]
    grown = True
    while grown and driven:
        before = len(driven)
        for tie in ties:
            if tie & driven:
                driven |= tie - {0}
        grown = len(driven) > before
    return driven


def _pulled(model: mujoco.MjModel, actuator: int) -> set[int]:
    """Return the roots of the trees on which an actuator acts."""
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
        return _held_by(model, target)
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        body = int(model.jnt_bodyid[target])
    elif kind == int(mujoco.mjtTrn.mjTRN_BODY):
        body = target
    else:
        body = int(model.site_bodyid[target])
    return {int(model.body_rootid[body])}


def _held_by(model: mujoco.MjModel, tendon: int) -> set[int]:
    """Return the roots of the trees that a tendon joins."""
    bodies_of = {
        int(mujoco.mjtWrap.mjWRAP_JOINT): model.jnt_bodyid,
        int(mujoco.mjtWrap.mjWRAP_SITE): model.site_bodyid,
        int(mujoco.mjtWrap.mjWRAP_SPHERE): model.geom_bodyid,
        int(mujoco.mjtWrap.mjWRAP_CYLINDER): model.geom_bodyid,
    }
    found = set()
    for wrap in _wraps(model, tendon):
        bodies = bodies_of.get(int(model.wrap_type[wrap]))
        if bodies is not None:
            found.add(int(model.body_rootid[bodies[model.wrap_objid[wrap]]]))
    return found


def _tied_by(model: mujoco.MjModel, equality: int) -> set[int]:
    """Return the roots of the trees that an equality constraint ties."""
    kind = int(model.eq_type[equality])
    ids = [int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])]
    ids = [one for one in ids if one >= 0]
    if kind == int(mujoco.mjtEq.mjEQ_TENDON):
        return {root for one in ids for root in _held_by(model, one)}
    if kind == int(mujoco.mjtEq.mjEQ_JOINT):
        return {int(model.body_rootid[model.jnt_bodyid[one]]) for one in ids}
    if kind not in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
        return set()
    if int(model.eq_objtype[equality]) == int(mujoco.mjtObj.mjOBJ_SITE):
        ids = [int(model.site_bodyid[one]) for one in ids]
    return {int(model.body_rootid[one]) for one in ids}


def _wraps(model: mujoco.MjModel, tendon: int) -> range:
    """Return the ids of what a tendon passes."""
    first = int(model.tendon_adr[tendon])
    return range(first, first + int(model.tendon_num[tendon]))
