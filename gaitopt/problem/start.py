"""The state before a gait: the targets held, and the pose in which the robot rests under them."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem

_LAGS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
"""Dynamics of an actuator whose activation follows its target."""

START = "start"
"""Keyframe from which every gait begins."""

SETTLE_LIMIT_S = 20.0
"""A robot that does not rest after this time is taken as it is, s."""

SETTLE_LIMIT_STEPS = 1_000_000
"""Steps after which settling ends too, however small the timestep."""

_SETTLE_CHUNK_S = 0.25
"""Time between two checks whether the robot rests, s."""

_REST_SPEED = 1e-6
"""Largest generalised speed at rest, rad/s or m/s: a hundredth of the required 0.1 mm/s."""


def start_targets(problem: Problem) -> NDArray[np.float64]:
    """Return the targets that the servos hold before the gait, rad, shape (nu,)."""
    held = problem.file.start.ctrl_deg
    return np.deg2rad([held.get(name, 0.0) for name in problem.channel_names])


def held_activation(
    model: mujoco.MjModel, ctrl: NDArray[np.float64], act: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return activations, shape (na,), in which each actuator with a lag has held its target for long.

    Args:
        model: the robot.
        ctrl: the targets, rad, shape (nu,).
        act: activations of all other actuators, shape (na,).
    """
    rested = np.array(act)
    for index in range(model.nu):
        if int(model.actuator_dyntype[index]) in _LAGS:
            last = int(model.actuator_actadr[index]) + int(model.actuator_actnum[index]) - 1
            rested[last] = ctrl[index]
    return rested


def settled(
    model: mujoco.MjModel, held: NDArray[np.float64], limit_s: float = SETTLE_LIMIT_S
) -> NDArray[np.float64]:
    """Return the pose in which the robot comes to rest under constant targets, shape (nq,).

    It falls from its keyframe 0 or its default pose. A robot that never rests is returned as it is
    after `limit_s`; `gaitopt check` reports that.

    Args:
        model: the robot.
        held: the targets, rad, shape (nu,).
        limit_s: when to stop at the latest, s of simulated time.

    Raises:
        GaitoptError: MuJoCo stops, because the MJCF allows it too little memory.
    """
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = held
    data.act[:] = held_activation(model, held, data.act)
    steps = max(1, round(_SETTLE_CHUNK_S / model.opt.timestep))
    limit_s = min(limit_s, SETTLE_LIMIT_STEPS * model.opt.timestep)
    for _ in range(max(1, round(limit_s / _SETTLE_CHUNK_S))):
        try:
            mujoco.mj_step(model, data, steps)
        except mujoco.FatalError as error:
            raise GaitoptError(f"the robot cannot be brought to rest: {error}") from None
        if np.abs(data.qvel).max(initial=0.0) < _REST_SPEED:
            break
    return np.array(data.qpos)
