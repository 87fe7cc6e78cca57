"""Grip that differs from step to step by chance; the coefficient is set while the model runs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import GRIP_VARIATION_SEED, Stream, generator
from gaitopt.effects.effect import Effect, Update, loop_interval_s
from gaitopt.effects.library.friction import Friction, pads_without_say
from gaitopt.effects.library.ground_loads import load_addresses, sense_pads
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_LOADED = 0.01
"""A pad that carries less than this share of the robot's weight is free."""

_FREE_S = 0.03
"""A step begins when a pad takes load after it was free for this long, s: a simulated contact that chatters
is free for a few milliseconds, a foot that swings for a twentieth of a second or more."""


def _gripping(parts: Parts, relative_sd: float) -> Update:
    """Return the loop that draws a pad's coefficient anew whenever the pad takes load again.

    What is under a pad and how it lies there is settled when it is set down: dust, a scratch of the floor, an
    edge that does not touch. Until it is lifted, its coefficient stays. The factor is log-normal with mean 1,
    independent from pad to pad and from step to step. A pad that is never lifted keeps its first one.
    """
    friction = Friction(parts.model, parts.pads)
    forces = np.add.outer(load_addresses(parts, parts.pads), range(3))
    down, least = -parts.axes[2], _LOADED * parts.weight
    variance = math.log1p(relative_sd**2)
    draws = [generator(GRIP_VARIATION_SEED, Stream.GRIP_VARIATION, pad) for pad in range(len(parts.pads))]
    interval = loop_interval_s(parts.step_s)
    free_s = [math.inf] * len(parts.pads)

    def update(sensed: NDArray[np.float64]) -> None:
        for pad, load in enumerate((sensed[forces] @ down).tolist()):
            if load <= least:
                free_s[pad] += interval
                continue
            if free_s[pad] > _FREE_S:
                normal = float(draws[pad].standard_normal())
                friction.scale(pad, math.exp(math.sqrt(variance) * normal - 0.5 * variance))
            free_s[pad] = 0.0

    return Update(update)


GRIP_VARIATION = Effect(
    name="grip_variation",
    rough=True,
    summary="coefficient of each pad drawn anew at each of its steps: log-normal, mean kept, with this "
    "relative standard deviation",
    parameter="relative_sd",
    unit="",
    neutral=0.0,
    low=0.0,
    high=0.6,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.15,
        "friction measured again in one laboratory scatters by 9 to 13 % (VAMAS round robin, Wear 114, "
        "1987); a walking pad is set down less evenly",
    ),
    allowed=(0.0, 2.0),
    role="pads",
    missing=pads_without_say,
    structure=sense_pads,
    loop=_gripping,
)
