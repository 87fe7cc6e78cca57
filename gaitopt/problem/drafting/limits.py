"""Limits that keep a search from false winners: by family, by the servos and by the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from gaitopt.problem.drafting.standing import Standing, size_of
from gaitopt.problem.robot import Robot
from gaitopt.robot.tree import robot_bodies

_ON_LEGS = (("tilt_rad", 0.6, 0.2), ("sideways_ratio", 0.35, 0.35), ("yaw_rate_rad_s", 0.2, 0.2))

_BY_FAMILY: Mapping[str, Sequence[tuple[str, float, float]]] = {
    "crawler": (("airtime", 0.1, 0.05), ("tilt_rad", 0.8, 0.2), ("sideways_ratio", 0.35, 0.35)),
    "quadruped": _ON_LEGS,
    "hexapod": _ON_LEGS,
    "snake": (("airtime", 0.1, 0.05), ("sideways_ratio", 0.5, 0.35)),
    "swimmer": (("sideways_ratio", 0.5, 0.35),),
    "other": (("tilt_rad", 0.8, 0.2), ("sideways_ratio", 0.35, 0.35)),
}
"""Metric, limit and scale: a trot flies for moments, a swimmer always, and the head of a snake swings."""

_DEEP, _AT_REST = 0.015, 4.0
"""A foot sinks no deeper than this share of the robot's size, or this many times as deep as at rest: 3 mm for
a robot of 0.2 m. Beyond it a search finds gaits that stamp into a ground that is too soft."""


@dataclass(frozen=True)
class DraftedLimit:
    """A limit of a metric.

    Attributes:
        metric: its name.
        most: the largest value that is allowed, in the metric's unit.
        scale: how much more is a serious violation.
        why: what it is for, or why it does not hold yet.
        holds: whether it is one; otherwise it is a comment.
    """

    metric: str
    most: float
    scale: float
    why: str = ""
    holds: bool = True


def draft_limits(family: str, model: mujoco.MjModel, standing: Standing) -> list[DraftedLimit]:
    """Return the limits of a robot.

    Args:
        family: one of `family.FAMILIES`.
        model: the robot.
        standing: how it stands.
    """
    limits = [DraftedLimit(*one) for one in _BY_FAMILY[family]]
    followed = bool(np.isfinite(Robot.of(model).no_load_speed).any())
    why = "no servo is asked for more than its speed without load: torque limit over the joint's damping"
    if not followed:
        why = "for servos with a torque limit on joints with damping: no servo faster than it can"
    limits.append(DraftedLimit("command_speed_ratio", 1.0, 0.3, why, followed))
    if standing.touching:
        deep = _two_digits(max(_DEEP * size_of(model, standing.drawn), _AT_REST * _depth(model, standing)))
        why = "a foot that sinks deeper stamps into a ground that is too soft"
        limits.append(DraftedLimit("penetration_m", deep, _two_digits(0.5 * deep), why))
    return limits


def _depth(model: mujoco.MjModel, standing: Standing) -> float:
    """Return how deep the robot at rest lies in what it touches, m."""
    contacts = standing.rested.contact
    own = robot_bodies(model)[model.geom_bodyid]
    mixed = own[contacts.geom].sum(axis=1) == 1
    return float(max(0.0, -contacts.dist[mixed].min(initial=0.0)))


def _two_digits(value: float) -> float:
    return round(value, 1 - math.floor(math.log10(value)))
