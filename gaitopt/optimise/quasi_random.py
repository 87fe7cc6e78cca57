"""Quasi-random gaits: points that cover the gait space evenly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from gaitopt.core.interrupts import interrupts_held
from gaitopt.core.streams import Stream, generator
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
