"""Coefficients of friction of the parts that touch the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


class Friction:
    """The coefficients of some geoms of a model, and of the pairs that have them."""

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
        "log-normal", 1.0, 0.25, "dust, wear and another floor change the grip of tape and glue by a quarter"
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
