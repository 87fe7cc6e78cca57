"""Contact with the ground: coefficients that depend on the part, the direction, the load.

A contact's tangential force is at most mu N [N]. MuJoCo's geoms have one coefficient for all
directions; pairs of geoms have one for each of two fixed axes; a coefficient that depends on force is
set anew while the model runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import LOOP_INTERVAL_S, Effect, Parts, Prior, Update, added_name
from gaitopt.robot.contact import can_touch, can_touch_ground, ground_geoms, mixed_friction

_LOADED = 0.02
"""A geom that carries less than this share of the robot's weight does not count as loaded."""

_LOAD_S = 0.02
"""Time constant over which a load counts: a simulated contact chatters, a power of its force would not
have the power of its mean."""

_STAND_S = 0.05
"""Time over which the loads at the start are averaged."""

_NET_FORCE = 3
"""MuJoCo's number of ``reduce="netforce"`` in a contact sensor."""

_FACTORS = (0.2, 5.0)
"""How far load may change a coefficient: a pad that hardly touches has no measured coefficient."""


class Friction:
    """The coefficients of some geoms of a model, on the geoms and on the pairs they are in."""

    def __init__(self, model: mujoco.MjModel, geoms: Sequence[int]):
        self._model = model
        pairs = [np.flatnonzero((model.pair_geom1 == g) | (model.pair_geom2 == g)) for g in geoms]
        self._base = [
            (g, rows, model.geom_friction[g].copy(), model.pair_friction[rows].copy())
            for g, rows in zip(geoms, pairs, strict=True)
        ]

    def scale(self, index: int, factor: float) -> None:
        """Set the coefficients of the geom at `index` to `factor` times what they were."""
        geom, rows, of_geom, of_pairs = self._base[index]
        self._model.geom_friction[geom] = factor * of_geom
        if len(rows):
            self._model.pair_friction[rows] = factor * of_pairs


def _scale_friction(parts: Parts, geoms: Sequence[int], factor: float) -> None:
    friction = Friction(parts.model, geoms)
    for index in range(len(geoms)):
        friction.scale(index, factor)


def _scale_pads(parts: Parts, scale: float, _: float) -> None:
    _scale_friction(parts, parts.pads, scale)


def _scale_body(parts: Parts, scale: float, _: float) -> None:
    _scale_friction(parts, parts.body, scale)


PAD_FRICTION = Effect(
    name="pad_friction",
    summary="coefficient of friction of the pads",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.25, "dust, wear and another floor change tape's and glue's grip by a quarter"
    ),
    allowed=(0.0, math.inf),
    role="pads",
    model=_scale_pads,
)

BODY_FRICTION = Effect(
    name="body_friction",
    summary="coefficient of friction of the other geoms that touch the ground",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior("log-normal", 1.0, 0.25, "card on wood or plastic: 0.2 to 0.5 by handbook"),
    allowed=(0.0, math.inf),
    role="body",
    model=_scale_body,
)


# --- direction ----------------------------------------------------------------------------------


def _touching(parts: Parts) -> list[int]:
    return parts.pads + parts.body


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
    if not _touching(parts):
        return "the problem names no roles.pads and no roles.body"
    if not any(can_touch_ground(parts.model, geom) for geom in _touching(parts)):
        return "no pad or body geom meets a geom of the world"
    return None


def _add_pairs(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Make an explicit pair of every geom that touches with every geom of the world that it meets."""
    for geom in _touching(nominal):
        for ground in ground_geoms(nominal.model):
            if can_touch(nominal.model, geom, ground):
                one, other = spec.geoms[ground], spec.geoms[geom]
                one.name = one.name or added_name("geom", str(ground))
                name = added_name("pair", f"{one.name}:{other.name}")
                spec.add_pair(name=name, geomname1=one.name, geomname2=other.name)


def _set_pairs(parts: Parts, ratio: float, _: float) -> None:
    """Give each added pair what its geoms would give it, and the sideways coefficient."""
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
    priority = model.geom_priority[geoms]
    weights = model.geom_solmix[geoms] / max(float(model.geom_solmix[geoms].sum()), 1e-15)
    if priority[0] != priority[1]:
        weights = (priority == priority.max()).astype(float)
        model.pair_dim[pair] = model.geom_condim[geoms[int(priority.argmax())]]
    else:
        model.pair_dim[pair] = model.geom_condim[geoms].max()
    slide, spin, roll = mixed_friction(model, *geoms)
    solref = model.geom_solref[geoms]
    direct = weights.max() < 1.0 and bool((solref[:, 0] <= 0.0).any())
    model.pair_friction[pair] = slide, slide, spin, roll, roll
    model.pair_solref[pair] = solref.min(axis=0) if direct else weights @ solref
    model.pair_solimp[pair] = weights @ model.geom_solimp[geoms]
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


def _sense_loads(spec: mujoco.MjSpec, nominal: Parts, geoms: Sequence[int]) -> None:
    """Add a sensor of each geom's net force on the ground, in the world."""
    for geom in geoms:
        name = nominal.model.geom(geom).name
        if spec.sensor(added_name("load", name)) is not None:
            continue
        spec.add_sensor(
            name=added_name("load", name),
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=name,
            reftype=mujoco.mjtObj.mjOBJ_BODY,
            refname="world",
            intprm=[1 << mujoco.mjtConDataField.mjCONDATA_FORCE.value, _NET_FORCE, 1],
        )


def _load_addresses(parts: Parts, geoms: Sequence[int]) -> list[int]:
    model = parts.model
    return [int(model.sensor(added_name("load", model.geom(g).name)).adr[0]) for g in geoms]


def _sense_pads(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    _sense_loads(spec, nominal, nominal.pads)


def _directed(parts: Parts, ratio: float) -> Update:
    """Return what sets each pad's coefficient from the direction of the ground's force on it.

    A force forward resists a backward slip, whether the pad slips yet or sticks. Between backward and
    sideways the coefficient lies on an ellipse; forward and sideways it is the nominal one.
    """
    friction = Friction(parts.model, parts.pads)
    addresses = _load_addresses(parts, parts.pads)
    forward, left, _ = parts.axes.tolist()

    def update(sensed: NDArray[np.float64]) -> None:
        for index, adr in enumerate(addresses):
            force = sensed[adr : adr + 3].tolist()
            ahead, aside = -_dot(force, forward), _dot(force, left)
            size = math.hypot(ahead, aside)
            if size > 0.0:
                share = max(0.0, ahead / size)
                friction.scale(index, 1.0 / math.sqrt(1.0 - share**2 + (share / ratio) ** 2))

    return update


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
    prior=Prior("log-normal", 1.0, 0.3, "a pad's edge digs in one way and is dragged over the other"),
    allowed=(0.0, math.inf),
    role="pads",
    structure=_sense_pads,
    loop=_directed,
)


# --- load ---------------------------------------------------------------------------------------


def _sense_all(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    _sense_loads(spec, nominal, _touching(nominal))


def _weight(parts: Parts) -> float:
    return float(parts.model.body_subtreemass[1]) * float(np.linalg.norm(parts.model.opt.gravity))


def _mean_load(parts: Parts, addresses: Sequence[int]) -> float:
    """Return the weight over the number of geoms that carry it at the start, N."""
    model = parts.model
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    steps = max(1, round(_STAND_S / model.opt.timestep))
    loads = np.zeros(len(addresses))
    for _ in range(steps):
        mujoco.mj_step(model, data)
        forces = data.sensordata[np.add.outer(addresses, range(3))]
        loads -= forces @ parts.axes[2] / steps
    weight = _weight(parts)
    return weight / max(1, int(np.sum(loads > _LOADED * weight)))


def _loaded(parts: Parts, exponent: float) -> Update:
    """Return what sets each coefficient to mu (load / mean load)^(-exponent), of smoothed loads."""
    geoms = _touching(parts)
    friction = Friction(parts.model, geoms)
    addresses = _load_addresses(parts, geoms)
    forces = np.add.outer(addresses, range(3))
    up = parts.axes[2]
    mean = _mean_load(parts, addresses)
    least = _LOADED * _weight(parts)
    loads = [0.0] * len(geoms)

    def update(sensed: NDArray[np.float64]) -> None:
        for index, pressed in enumerate((sensed[forces] @ up).tolist()):
            if pressed == loads[index] == 0.0:
                continue
            weight = LOOP_INTERVAL_S / _LOAD_S if loads[index] > least else 1.0
            loads[index] -= weight * (pressed + loads[index])
            if loads[index] > least:
                factor = (loads[index] / mean) ** -exponent
                friction.scale(index, min(max(factor, _FACTORS[0]), _FACTORS[1]))

    return update


def _nothing_touches(parts: Parts) -> str | None:
    return None if _touching(parts) else "the problem names no roles.pads and no roles.body"


FRICTION_LOAD = Effect(
    name="friction_load",
    summary="coefficients go with load^(-exponent) about the mean load of the geoms that carry the robot",
    parameter="exponent",
    unit="",
    neutral=0.0,
    low=-0.3,
    high=1.0,
    scale="lin",
    prior=Prior(
        "normal", 0.0, 0.2, "0 is Amontons' law; a smooth elastic contact goes with load^(-1/3) (Hertz)"
    ),
    allowed=(-1.0, 1.0),
    missing=_nothing_touches,
    structure=_sense_all,
    loop=_loaded,
)


# --- stiffness ----------------------------------------------------------------------------------


def _soften(parts: Parts, scale: float, _: float) -> None:
    """Scale time constants; of the other format (-stiffness, -damping), by what a time constant is in it."""
    for solref in (parts.model.geom_solref, parts.model.pair_solref):
        direct = solref[:, 0] < 0.0
        solref[~direct, 0] *= scale
        solref[direct] /= (scale**2, scale)


CONTACT_COMPLIANCE = Effect(
    name="contact_compliance",
    summary="time constant of contact with the ground",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.25,
    high=4.0,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.5, "chosen for the simulator, not measured; tape, glue and card give way"
    ),
    allowed=(0.0, math.inf),
    model=_soften,
)
