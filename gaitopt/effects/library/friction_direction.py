"""Friction that depends on the direction of slip.

MuJoCo's geoms have one coefficient for all directions; pairs of geoms have one for each of two fixed axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import added_name
from gaitopt.effects.effect import Effect, Update
from gaitopt.effects.library.friction import Friction, pads_without_say
from gaitopt.effects.library.ground_loads import load_addresses, sense_pads
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.robot.contact import can_touch, mixed_contact


def _contact_axes(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the two tangents of MuJoCo's contact frame on a plane with normal `up`, shape (2, 3)."""
    first = np.array([0.0, 1.0, 0.0]) if abs(up[1]) < 0.5 else np.array([0.0, 0.0, 1.0])
    first = first - up * (first @ up)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def _not_along_an_axis(parts: Parts) -> str | None:
    forward, _, up = parts.axes
    if np.abs(_contact_axes(up) @ forward).max() < 1.0 - 1e-6:
        return "forward is not along a world axis, as MuJoCo's contact frames are"
    if not parts.touching:
        return "the problem names no roles.pads and no roles.body"
    if not any(parts.touches_ground(geom) for geom in parts.touching):
        return "no pad or body geom collides with a geom of the world"
    return None


def _add_pairs(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add a pair for each geom that may touch the ground and each geom of the world that it collides with."""
    for geom in nominal.touching:
        for ground in nominal.surroundings:
            if can_touch(nominal.model, geom, ground):
                one, other = spec.geoms[ground], spec.geoms[geom]
                one.name = one.name or added_name("geom", str(ground))
                name = added_name("pair", f"{one.name}:{other.name}")
                spec.add_pair(name=name, geomname1=one.name, geomname2=other.name)


def _set_pairs(parts: Parts, ratio: float, _: float) -> None:
    """Give each added pair the values that its geoms would have, and the sideways coefficient."""
    model = parts.model
    forward, _left, up = parts.axes
    sideways = int(np.abs(_contact_axes(up) @ forward).argmin())
    for pair in range(model.npair):
        if model.pair(pair).name.startswith(added_name("pair", "")):
            _mix(model, pair)
            model.pair_friction[pair, sideways] *= ratio


def _mix(model: mujoco.MjModel, pair: int) -> None:
    """Set a pair's contact parameters by MuJoCo's rules: priority, else maximum and weighted mean."""
    geoms = [int(model.pair_geom1[pair]), int(model.pair_geom2[pair])]
    contact = mixed_contact(model, *geoms)
    slide, spin, roll = contact.friction
    model.pair_dim[pair] = contact.condim
    model.pair_friction[pair] = slide, slide, spin, roll, roll
    model.pair_solref[pair] = contact.solref
    model.pair_solimp[pair] = contact.solimp
    model.pair_margin[pair] = model.geom_margin[geoms].max()
    model.pair_gap[pair] = model.geom_gap[geoms].max()


FRICTION_ANISOTROPY = Effect(
    name="friction_anisotropy",
    summary="sideways over forward coefficient of everything that touches the ground",
    parameter="ratio",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior("log-normal", 1.0, 0.25, "glue lines across the pads, card's grain, woven or brushed floors"),
    allowed=(0.0, math.inf),
    missing=_not_along_an_axis,
    structure=_add_pairs,
    model=_set_pairs,
)


def _directed(parts: Parts, ratio: float) -> Update:
    """Return the loop that sets each pad's coefficient from the direction of the ground's force on it.

    A forward force resists backward slip, whether the pad slips already or still sticks. Between backward
    and sideways the coefficient lies on an ellipse; forward and sideways it is the nominal one.
    """
    friction = Friction(parts.model, parts.pads)
    addresses = load_addresses(parts, parts.pads)
    forward, left, _ = parts.axes.tolist()

    def update(sensed: NDArray[np.float64]) -> None:
        for index, adr in enumerate(addresses):
            force = sensed[adr : adr + 3].tolist()
            ahead, aside = -_dot(force, forward), _dot(force, left)
            size = math.hypot(ahead, aside)
            if size > 0.0:
                share = max(0.0, ahead / size)
                friction.scale(index, 1.0 / math.sqrt(1.0 - share**2 + (share / ratio) ** 2))

    return Update(update)


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


FRICTION_DIRECTION = Effect(
    name="friction_direction",
    summary="coefficient of the pads against backward slip, over that against forward slip",
    parameter="ratio",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.3, "a pad's edge digs in when it slips one way and glides the other way"
    ),
    allowed=(0.0, math.inf),
    role="pads",
    missing=pads_without_say,
    structure=sense_pads,
    loop=_directed,
)
