"""Compliance of contacts."""

from __future__ import annotations

import math

import mujoco

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


def _nothing_touches(parts: Parts) -> str | None:
    off = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return "the robot is held, and touches nothing" if parts.model.opt.disableflags & off else None


def _soften(parts: Parts, scale: float, _: float) -> None:
    """Scale time constants; in the format (-stiffness, -damping), stiffness and damping to match."""
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
        "log-normal", 1.0, 0.5, "chosen for the simulator, not measured; tape, glue and card are compliant"
    ),
    allowed=(0.0, math.inf),
    missing=_nothing_touches,
    model=_soften,
)
