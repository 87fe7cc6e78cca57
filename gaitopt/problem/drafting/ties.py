"""Which servos of a robot may move alike: its legs in the phases of a template, or the joints of its body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.problem.drafting.family import Limb, limbs_of, rows_of
from gaitopt.problem.drafting.gaits import Travel, from_front
from gaitopt.problem.drafting.standing import Standing
from gaitopt.problem.ties import HEXAPOD, QUADRUPED, SPINE, UNDULATION
from gaitopt.robot.tree import driven_joints, trunk

Array = NDArray[np.float64]

_PARALLEL = 0.7
"""Cosine of the angle between two axes above which joints are taken for the same."""

_COMMON = 0.5
"""Joints whose ranges have less than this share of the narrower one in common do not move alike."""


@dataclass(frozen=True)
class DraftedTies:
    """Templates for a robot, and what they need; see `ties.GaitBounds`."""

    templates: Sequence[str]
    legs: Mapping[str, Sequence[str]]
    mirrored: Sequence[str]


def draft_ties(
    family: str,
    model: mujoco.MjModel,
    standing: Standing,
    pads: Sequence[int],
    axes: Array,
    travels: Sequence[Travel],
) -> DraftedTies | None:
    """Return which servos may move alike; None where that cannot be told.

    Args:
        family: one of `family.FAMILIES`.
        model: the robot.
        standing: how it stands.
        pads: geoms that grip.
        axes: forward, left and up as rows.
        travels: what each servo may do, in the model's order.
    """
    parts = _Parts(model, standing, axes, travels)
    if family in ("snake", "swimmer"):
        return parts.tied([UNDULATION], {SPINE: from_front(model, standing, axes)})
    names = {"quadruped": QUADRUPED, "hexapod": HEXAPOD}.get(family, ())
    legs = parts.named(limbs_of(model, pads), names)
    templates = ["tripod"] if family == "hexapod" else ["trot", "walk", "bound"]
    return parts.tied(templates, legs) if legs else None


@dataclass(frozen=True)
class _Parts:
    """The servos of a robot, and what they turn."""

    model: mujoco.MjModel
    standing: Standing
    axes: Array
    travels: Sequence[Travel]

    def axis(self, servo: int) -> Array | None:
        """Return the axis that a servo turns about, forward, left and up, shape (3,), or None.

        Of several joints on a tendon it is that of the one that it turns most.
        """
        joints = driven_joints(self.model, servo)
        if not joints:
            return None
        joint, share = max(joints.items(), key=lambda one: abs(one[1]))
        if self.model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            return None
        axis: Array = self.axes @ self.standing.rested.xaxis[joint] * np.sign(share)
        return axis

    def named(self, limbs: Sequence[Limb], names: Sequence[str]) -> dict[str, Sequence[int]]:
        """Return the servos of each leg by the leg's name; none where legs are not where they should be."""
        rows = list(dict.fromkeys(name.partition("_")[0] for name in names))
        rested = self.standing.rested
        middles = [rested.geom_xpos[list(limb.feet)].mean(axis=0) for limb in limbs]
        feet = [self.axes @ (middle - rested.xpos[trunk(self.model)]) for middle in middles]
        seats = rows_of(feet, len(rows))
        if not seats:
            return {}
        legs = {
            f"{rows[row]}_{'left' if left else 'right'}": limb.servos
            for limb, (left, row) in zip(limbs, seats, strict=True)
        }
        return {name: legs[name] for name in names}

    def tied(self, templates: Sequence[str], legs: Mapping[str, Sequence[int]]) -> DraftedTies | None:
        """Return the ties of legs, or None where their joints differ."""
        spine = SPINE in legs
        first = next(iter(legs.values()))
        pairs = [
            (first[0] if spine else first[i], servo, leg.endswith("right"))
            for leg, servos in legs.items()
            for i, servo in enumerate(servos)
            if spine or i < len(first)
        ]
        servos = [servo for leg in legs.values() for servo in leg]
        alike = all(len(leg) == len(first) for leg in legs.values()) and len(set(servos)) == len(servos)
        signs = [self._sign(*pair) for pair in pairs]
        if not alike or len(servos) < 2 or not all(signs):
            return None
        names = [self.travels[servo].name for _, servo, _ in pairs]
        mirrored = [name for name, sign in zip(names, signs, strict=True) if sign < 0]
        named = {leg: [self.travels[servo].name for servo in servos] for leg, servos in legs.items()}
        return DraftedTies(templates, named, mirrored)

    def _sign(self, leader: int, servo: int, across: bool) -> int:
        """Return 1 where a servo moves like its leader, -1 where mirrored, 0 where neither.

        Across the middle plane an axis is turned as a mirror turns it. So is that of a hind leg which is a
        fore leg turned round, where the axes are not parallel: legs that point to the corners. Joints that
        rest at opposite angles are mirrored: knees that point forward and backward.
        """
        one, other = self.axis(leader), self.axis(servo)
        if one is None or other is None:
            return 0
        seen = one * (-1.0, 1.0, -1.0) if across else one
        cosines = [float(seen @ other), float(seen * (1.0, -1.0, -1.0) @ other)]
        cosine = next((cosine for cosine in cosines if abs(cosine) >= _PARALLEL), None)
        if cosine is None:
            return 0
        sign = 1 if cosine > 0.0 else -1
        a, b = self.travels[leader], self.travels[servo]
        if abs(b.rest - sign * a.rest) > abs(b.rest + sign * a.rest) + 1e-6:
            sign = -sign
        low, high = sorted((sign * b.low, sign * b.high))
        common = min(high, a.high) - max(low, a.low)
        narrower = min(high - low, a.high - a.low)
        return sign if common >= _COMMON * narrower and a.sign == b.sign else 0
