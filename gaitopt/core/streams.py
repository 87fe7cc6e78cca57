"""Random streams: with a run's seed, each name gives its own draws."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What a random stream is for.

    The numbers decide the bits of every result, so they never change. A new stream takes a new number.
    Some names share a number: one of them draws scenarios and the other moves a solver. Such streams begin
    with the same state and have nothing else in common.
    """

    SEARCH_SCENARIOS = 1
    SELECTION_SCENARIOS = 2
    VERIFICATION_SCENARIOS = 3
    SENSITIVITY_SCENARIOS = 4
    CMA_ES = 1
    NELDER_MEAD = 2
    QUASI_RANDOM = 3
    NEAR_PLAN = 4
    FRONT = 16  # and the numbers after it, one for each search of the front, up to 19
    FLOOR_START_POSES = 20
    SMALL_ERRORS = 21
    CHANCE_GAIN = 22
    GAP_BOOTSTRAP = 24
    EXPERIMENT_CANDIDATES = 25
    PRECISION_ROBOTS = 26
    BLIND_CASE = 30
    BLIND_KINDS = 31
    EXPERIMENT_ROBOTS = 34
    COMMAND_SHAPES = 35
    CORRECTED_SEARCH = 40
    SOLVER = 41  # with the name of a solver that has no stream of its own
    COMMAND_JITTER = 42
    GRIP_VARIATION = 43  # with the place of a pad among the pads
    POSTERIOR_ORDER = 45
    POSTERIOR_DRAWS = 46
    ENSEMBLE_NOISE = 47
    ENSEMBLE_POSES = 48
    TIED_FIRST_BATCH = 50  # with the place of a template among the templates
    FREED_SEARCH = 51
    CAMPAIGN_ROBOTS = 60
    CAMPAIGN_SEARCH = 61  # with the number of a robot
    CAMPAIGN_BELIEF = 62
    CAMPAIGN_RIVALS = 63
    TOLERANT_ROBOTS = 70
    CONFIRMATION_SCENARIOS = 71
    TAG_MOUNTING = 72  # with the stream of the robot's other errors and the number of the robot
    ALMOST_EQUAL_ROBOTS = 73
    LUCK = 74


BLIND_FLOOR_SEED = 12345
"""Seed of the robots with which blind cases measure their floor. It does not depend on the cases' seed."""

COMMAND_JITTER_SEED = 0
"""Seed of the delays of an effect: two simulations of the same commands have the same delays."""

GRIP_VARIATION_SEED = 0
"""Seed of the grip of an effect: a pad's n-th step has the same grip in every simulation."""


def generator(seed: int, stream: int, *index: int) -> np.random.Generator:
    """Return the generator of a stream.

    Args:
        seed: seed of the run.
        stream: a `Stream`, or one of the numbers that it reserves.
        index: which of several draws of the stream, such as the number of a case.
    """
    return np.random.default_rng([seed, int(stream), *index])


def seeded(*seed: int) -> np.random.Generator:
    """Return the generator of a seed that was drawn or written elsewhere, such as that of a start pose."""
    return np.random.default_rng(list(seed))
