"""Coefficients of friction of the parts that touch the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


class Friction:
    """The coefficients of some geoms of a model, and of the pairs that have them.

    Several effects may scale the coefficients of one geom: their factors multiply. Some do so thousands of
    times a second, so numbers are set one by one: arrays of so few take several times as long.
    """

    def __init__(self, model: mujoco.MjModel, geoms: Sequence[int]):
        pairs = [np.flatnonzero((model.pair_geom1 == g) | (model.pair_geom2 == g)) for g in geoms]
        self._of_geoms = [_places(model.geom_friction, [geom]) for geom in geoms]
        self._of_pairs = [_places(model.pair_friction, rows) for rows in pairs]
        self._geoms, self._pairs = model.geom_friction.reshape(-1), model.pair_friction.reshape(-1)
        self._factors = [1.0] * len(geoms)

    def scale(self, index: int, factor: float) -> None:
        """Set the coefficients of the geom at `index` to `factor` times what they would be without it."""
        change = factor / self._factors[index]
        if change == 1.0:
            return
        self._factors[index] = factor
        for coefficients, places in ((self._geoms, self._of_geoms), (self._pairs, self._of_pairs)):
            for place in places[index]:
                coefficients[place] = coefficients.item(place) * change


def _places(array: NDArray[np.float64], rows: Sequence[int] | NDArray[np.intp]) -> list[int]:
    """Return where some rows of an array are in it when it is flat."""
    places: list[int] = np.arange(array.size).reshape(array.shape)[rows].ravel().tolist()
    return places


def scale_friction(model: mujoco.MjModel, geoms: Sequence[int], factor: float) -> None:
    """Multiply the coefficients of geoms of a model, and of the pairs that have them, by a factor."""
    friction = Friction(model, geoms)
    for index in range(len(geoms)):
        friction.scale(index, factor)


def without_say(parts: Parts, geoms: Sequence[int]) -> str | None:
    """Return that the friction of a geom is not what MuJoCo uses where it touches the ground, or None."""
    for geom in geoms:
        for other in parts.overruled_by(geom):
            names = [parts.model.geom(i).name or "the ground" for i in (other, geom)]
            return f"{names[0]} has no lower priority than {names[1]}: its friction counts, or the larger one"
    return None


def pads_without_say(parts: Parts) -> str | None:
    """Return the same of the pads."""
    return without_say(parts, parts.pads)


def _scale_pads(parts: Parts, scale: float, _: float) -> None:
    scale_friction(parts.model, parts.pads, scale)


def _scale_body(parts: Parts, scale: float, _: float) -> None:
    scale_friction(parts.model, parts.body, scale)


def _one_pad(parts: Parts) -> str | None:
    if len(parts.pads) < 2:
        return "the problem names one pad in roles.pads"
    return pads_without_say(parts)


def _unbalance(parts: Parts, ratio: float, _: float) -> None:
    """Multiply the first pad's coefficient by `ratio`, then all pads' so that the mean factor is 1."""
    friction = Friction(parts.model, parts.pads)
    mean = (ratio + len(parts.pads) - 1) / len(parts.pads)
    for index in range(len(parts.pads)):
        friction.scale(index, (ratio if index == 0 else 1.0) / mean)


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
        "log-normal", 1.0, 0.25, "dust, wear and another floor change the grip of tape and glue by a quarter"
    ),
    allowed=(0.0, math.inf),
    role="pads",
    missing=pads_without_say,
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
    missing=lambda parts: without_say(parts, parts.body),
    model=_scale_body,
)

PAD_IMBALANCE = Effect(
    name="pad_imbalance",
    summary="friction of the first pad over that of the other pads, mean kept",
    parameter="ratio",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior(
        "log-normal",
        1.0,
        0.2,
        "pads made one by one, of tape and glue, and each worn and dusty in its own way",
    ),
    allowed=(0.0, math.inf),
    role="pads",
    missing=_one_pad,
    model=_unbalance,
)
