"""Families of robots: which one a robot is of, by its limbs, its feet and what it lies on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from gaitopt.problem.drafting.heading import up_axis
from gaitopt.problem.drafting.standing import FALLEN_RAD, Standing, tilt_of
from gaitopt.robot.tree import driven_joints, every_driven_joint, in_water, robot_bodies, trunk

FAMILIES = ("crawler", "quadruped", "hexapod", "snake", "swimmer", "other")


@dataclass(frozen=True)
class Limb:
    """A leg, or what else carries a foot.

    Attributes:
        feet: its geoms that grip.
        servos: the actuators between the trunk and its feet, from the trunk on.
    """

    feet: tuple[int, ...]
    servos: tuple[int, ...]


def guess_pads(model: mujoco.MjModel, standing: Standing) -> tuple[list[int], str]:
    """Return the geoms that grip, and what that rests on.

    A robot that stands with its trunk off the ground stands on its pads. Of one whose trunk lies on the
    ground, the pads are the ends of driven limbs that touch it, if only while a servo moves; a robot without
    such limbs grips with all that touches.
    """
    touching = sorted(standing.touching)
    if not any(int(model.geom_bodyid[geom]) == trunk(model) for geom in touching):
        if touching:
            touching = _lowest_of_chains(model, touching)
            return touching, "pads: what touches the ground at rest under the start targets"
        return [], "pads: none, as nothing touches the ground at rest"
    ends = set() if is_chain(model) else _ends(model)
    reaching = sorted(
        geom for geom in standing.touching | standing.swinging if int(model.geom_bodyid[geom]) in ends
    )
    if reaching:
        return (
            reaching,
            "pads: ends of driven limbs that touch the ground while servos move, as the trunk lies on it",
        )
    return touching, "pads: all that touches the ground at rest under the start targets"


def _lowest_of_chains(model: mujoco.MjModel, geoms: Sequence[int]) -> list[int]:
    """Return geoms without those of a body that carries another one: a foot touches, and its shin almost."""
    bodies = {int(model.geom_bodyid[geom]) for geom in geoms}
    carrying = set()
    for body in bodies:
        parent = int(model.body_parentid[body])
        while parent:
            carrying.add(parent)
            parent = int(model.body_parentid[parent])
    return [geom for geom in geoms if int(model.geom_bodyid[geom]) not in carrying]


def is_chain(model: mujoco.MjModel) -> bool:
    """Return whether a robot is one chain of bodies, each with a servo to the next; idle wheels aside."""
    own, driven = robot_bodies(model), _driven_bodies(model)
    moving = [
        i
        for i in np.flatnonzero(own).tolist()
        if model.body_jntnum[i] and i != trunk(model) and (i in driven or not _is_wheel(model, i))
    ]
    parents = [_jointed_parent(model, body) for body in moving]
    return len(set(parents)) == len(parents) and len(moving) > 1


def _bends_sideways(model: mujoco.MjModel, standing: Standing) -> bool:
    """Return whether two servos of a chain, or its only one, turn about what is upright at rest."""
    joints = every_driven_joint(model)
    upright = np.abs(standing.rested.xaxis[sorted(joints)] @ up_axis(model)[0]) > 0.5
    return int(upright.sum()) >= min(2, len(joints))


def _driven_bodies(model: mujoco.MjModel) -> set[int]:
    """Return the bodies with a joint that an actuator turns."""
    joints = every_driven_joint(model)
    return {int(model.jnt_bodyid[joint]) for joint in joints}


def _is_wheel(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body turns without end and carries none."""
    joint, hinge = int(model.body_jntadr[body]), int(mujoco.mjtJoint.mjJNT_HINGE)
    alone = int(model.body_jntnum[body]) == 1 and body not in model.body_parentid.tolist()
    return alone and int(model.jnt_type[joint]) == hinge and not model.jnt_limited[joint]


def _jointed_parent(model: mujoco.MjModel, body: int) -> int:
    """Return the body from which a body moves: its next ancestor with a joint, or the trunk."""
    parent, base = int(model.body_parentid[body]), trunk(model)
    while parent not in (0, base) and not model.body_jntnum[parent]:
        parent = int(model.body_parentid[parent])
    return parent


def _ends(model: mujoco.MjModel) -> set[int]:
    """Return the bodies at the ends of limbs that an actuator moves, with what is fixed to them."""
    own = np.flatnonzero(robot_bodies(model)).tolist()
    inner = {int(model.body_parentid[body]) for body in own if model.body_jntnum[body]}
    ancestors = set(inner)
    for body in inner:
        while body:
            ancestors.add(body)
            body = int(model.body_parentid[body])
    ends = {body for body in own if body not in ancestors and body != trunk(model)}
    return {body for body in ends if _servos_above(model, body)}


def _servos_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the actuators that turn a joint between the trunk and a body, from the trunk on."""
    path = []
    while body not in (0, trunk(model)):
        path.append(body)
        body = int(model.body_parentid[body])
    found: list[int] = []
    for link in reversed(path):
        for actuator in range(model.nu):
            bodies = [int(model.jnt_bodyid[joint]) for joint in driven_joints(model, actuator)]
            if link in bodies and actuator not in found:
                found.append(actuator)
    return found


def limbs_of(model: mujoco.MjModel, pads: Sequence[int]) -> list[Limb]:
    """Return the limbs of a robot: pads that hang at the trunk by the same body, or by the same servos."""
    found: dict[tuple[int, ...], list[int]] = {}
    for pad in pads:
        servos = tuple(_servos_above(model, int(model.geom_bodyid[pad])))
        if servos:
            found.setdefault(servos, []).append(pad)
    shared = {key for key in found for other in found if key != other and set(key) < set(other)}
    return [Limb(tuple(feet), servos) for servos, feet in found.items() if servos not in shared]


def rows_of(feet: Sequence[Sequence[float]], rows: int) -> list[tuple[bool, int]]:
    """Return where each foot stands: whether on the left, and in which row from the front.

    Args:
        feet: each one's place, forward and to the left of the trunk, m.
        rows: rows of feet that the family has.

    Returns:
        Empty where there is not one foot on each side of each row.
    """
    found = [
        (left > 0.0, sum(other[0] > ahead and (other[1] > 0.0) == (left > 0.0) for other in feet))
        for ahead, left, *_ in feet
    ]
    whole = [(side, row) for side in (False, True) for row in range(rows)]
    return found if sorted(found) == whole else []


def guess_family(model: mujoco.MjModel, standing: Standing, pads: Sequence[int]) -> tuple[str, str]:
    """Return the family of a robot, and what that rests on."""
    limbs = limbs_of(model, pads)
    apart = len({limb.servos[0] for limb in limbs}) == len(limbs)
    lies = any(
        not _servos_above(model, int(model.geom_bodyid[geom])) for geom in standing.touching
    )  # on its trunk, or on wheels of it
    if in_water(model):
        return "swimmer", f"it is in a fluid of {model.opt.density:g} kg/m^3"
    fallen = tilt_of(model, standing, up_axis(model)[0]) > FALLEN_RAD
    if is_chain(model) and model.nu > 1 and (lies or not limbs) and not fallen:
        if _bends_sideways(model, standing):
            return "snake", "it is one chain of links that lies on the ground and bends sideways"
        return "crawler", "it is one chain of links that lies on the ground and bends up and down"
    if apart and len(limbs) in (4, 6):
        return {4: "quadruped", 6: "hexapod"}[len(limbs)], f"it has {len(limbs)} limbs with feet"
    if lies and not fallen:
        return "crawler", "its trunk lies on the ground"
    return "other", f"it stands on {len(pads)} pads of {len(limbs)} limbs"
