"""Quasi-random gaits: points that cover the gait space evenly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from gaitopt.core.interrupts import interrupts_held
from gaitopt.core.streams import Stream, generator
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.gait.ties import TiedSpace


def quasi_random(
    space: GaitSpace | TiedSpace, count: int, seed: int, stream: Stream = Stream.QUASI_RANDOM, *index: int
) -> NDArray[np.float64]:
    """Return scrambled Sobol points of the unit box, shape (count, d)."""
    with interrupts_held():  # Ctrl-C while SciPy reads its table would be lost
        sampler = qmc.Sobol(len(space.variables), rng=generator(seed, stream, *index))
    points: NDArray[np.float64] = sampler.random_base2(max(0, (count - 1).bit_length()))
    return points[:count]


def near_plan(
    space: GaitSpace, planned: Sequence[Gait], count: int, seed: int, spread: float, slower: float
) -> NDArray[np.float64]:
    """Return points near planned gaits, most of them slower, shape (count, d).

    A plan is fast where its model is, at the shortest periods. What the model does not know, such as a drift
    to one side, often spoils such gaits, and is less where the same motion has more time.

    Args:
        space: the gait space.
        planned: the gaits, taken in turn.
        count: how many points.
        seed: seed of the points.
        spread: standard deviation of each coordinate but the period, in units of the space.
        slower: the period is up to so many times as long, log-uniform.
    """
    draws = quasi_random(space, count, seed, Stream.NEAR_PLAN)
    low, high = space.period_s
    points = []
    for index, draw in enumerate(draws):
        gait = planned[index % len(planned)]
        period_s = min(max(low, gait.period_s * math.exp(draw[0] * math.log(slower))), high)
        step = spread * norm.ppf(np.clip(draw, 1e-6, 1.0 - 1e-6))
        step[0] = 0.0
        points.append(space.wrap(space.encode(replace(gait, period_s=period_s)) + step))
    return np.array(points).reshape(count, len(space.variables))
