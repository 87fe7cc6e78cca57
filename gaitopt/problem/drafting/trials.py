"""A first gait is played before it is drafted: does the robot stay on its feet, and which way does it go?"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.gait import EDGE_TOLERANCE, Channel
from gaitopt.problem.drafting.standing import Standing
from gaitopt.robot.tree import in_water, trunk

Array = NDArray[np.float64]

_TRIAL_S, _TRIAL_PERIODS = 4.0, 3.0
"""A first gait is tried for this time, s, and at least for as many periods."""

_TIPPED_RAD = 0.8
"""Tilt at which a robot that walks is about to fall, rad; at rest it may be `standing.FALLEN_RAD`."""

_MOST_FLIGHT = 0.35
"""Largest share of time without contact in a first gait."""


@dataclass(frozen=True)
class Wave:
    """One servo's wave in a first gait; see `gait.Channel`."""

    duty: float
    phase: float
    amplitude_deg: float
    offset_deg: float
    smoothing: float


@dataclass(frozen=True)
class Trial:
    """How a first gait went.

    Attributes:
        ran: whether it was simulated to the end, without long flights.
        upright: whether the trunk never tilted far, either.
        ahead_m_s: mean speed forward of the middle of mass after the first period, m/s.
    """

    ran: bool
    upright: bool
    ahead_m_s: float


def play(
    model: mujoco.MjModel, standing: Standing, waves: Mapping[str, Wave], period: float, axes: Array
) -> Trial:
    """Return how a gait goes from rest.

    Args:
        model: the robot.
        standing: how it stands.
        waves: the gait's waves, in the model's order.
        period: its period, s.
        axes: forward, left and up as rows.
    """
    model = copy.copy(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = copy.copy(standing.rested)
    channels = [Channel(**asdict(wave)) for wave in waves.values()]
    step, body = float(model.opt.timestep), trunk(model)
    up = standing.drawn.xmat[body].reshape(3, 3).T @ axes[2]
    cycles = np.arange(0.0, max(_TRIAL_S, _TRIAL_PERIODS * period), step) / period
    targets = np.stack([channel.targets(cycles, EDGE_TOLERANCE) for channel in channels], axis=-1)
    flights, tilted, ahead = 0, False, np.empty(len(targets))
    for index, row in enumerate(targets):
        data.ctrl[:] = row
        mujoco.mj_step(model, data)
        if data.warning.number.any():
            return Trial(False, False, -math.inf)
        flights += data.ncon == 0
        tilted = tilted or float(data.xmat[body].reshape(3, 3) @ up @ axes[2]) < math.cos(_TIPPED_RAD)
        ahead[index] = data.subtree_com[body] @ axes[0]
    ran = in_water(model) or flights <= _MOST_FLIGHT * len(targets)
    first, whole = np.searchsorted(cycles, [1.0, math.floor(cycles[-1])])
    speed = float(ahead[whole] - ahead[first]) / (step * max(1, whole - first))
    return Trial(ran, ran and not tilted, speed)
