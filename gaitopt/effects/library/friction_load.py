"""Friction that depends on the load of a contact; the coefficient is set while the model runs."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect, Update, loop_interval_s
from gaitopt.effects.library.friction import Friction, without_say
from gaitopt.effects.library.ground_loads import load_addresses, sense_loads
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_LOADED = 0.02
"""A geom that carries less than this share of the robot's weight does not count as loaded."""

_LOAD_S = 0.02
"""Time constant over which loads are averaged, s: a simulated contact chatters, and the mean of a power of
its force is not the power of its mean."""

_STAND_S = 0.05
"""Time over which the loads at the start are averaged."""


_FACTORS = (0.2, 5.0)
"""Smallest and largest factor on a coefficient: no coefficient has been measured at very small loads."""


def _sense_all(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    sense_loads(spec, nominal, nominal.touching)


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
    weight = parts.weight
    return weight / max(1, int(np.sum(loads > _LOADED * weight)))


def _loaded(parts: Parts, exponent: float) -> Update:
    """Return the loop that sets each coefficient to mu (load / mean load)^(-exponent); loads are smoothed."""
    geoms = parts.touching
    friction = Friction(parts.model, geoms)
    addresses = load_addresses(parts, geoms)
    forces = np.add.outer(addresses, range(3))
    up = parts.axes[2]
    mean = _mean_load(parts, addresses)
    least = _LOADED * parts.weight
    loads = [0.0] * len(geoms)
    share_new = min(1.0, loop_interval_s(parts.step_s) / _LOAD_S)

    def update(sensed: NDArray[np.float64]) -> None:
        for index, pressed in enumerate((sensed[forces] @ up).tolist()):
            if pressed == loads[index] == 0.0:
                continue
            weight = share_new if loads[index] > least else 1.0
            loads[index] -= weight * (pressed + loads[index])
            if loads[index] > least:
                factor = (loads[index] / mean) ** -exponent
                friction.scale(index, min(max(factor, _FACTORS[0]), _FACTORS[1]))

    return Update(update)


def _nothing_touches(parts: Parts) -> str | None:
    if not parts.touching:
        return "the problem names no roles.pads and no roles.body"
    return without_say(parts, parts.touching)


FRICTION_LOAD = Effect(
    name="friction_load",
    summary="coefficients are proportional to load^(-exponent), nominal at the mean load of the geoms that "
    "carry the robot",
    parameter="exponent",
    unit="",
    neutral=0.0,
    low=-0.3,
    high=1.0,
    scale="lin",
    prior=Prior("normal", 0.0, 0.2, "0 is Amontons' law; a smooth elastic contact has load^(-1/3) (Hertz)"),
    allowed=(-1.0, 1.0),
    missing=_nothing_touches,
    structure=_sense_all,
    loop=_loaded,
)
