"""How much work a simulation is, in counts: by a clock, no two runs would end with the same bits."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

_EMPTY_STEP = 300.0
"""Work of a step without joints or constraints."""

_PER_DOF = 25.0
"""Work of a step for each degree of freedom."""

_REST_STEPS = 20
"""Steps of standing still over which the work of one is averaged."""

Counts = Mapping[str, NDArray[np.int32]]
"""What MuJoCo counts of each step, by its name in `mujoco.MjData`."""


def counters(steps: int) -> Counts:
    """Return what a rollout of one simulation records its counts into, each of shape (1, steps, ...)."""
    return {
        "nJ": np.zeros((1, steps), np.int32),
        "solver_niter": np.zeros((1, steps, mujoco.mjNISLAND), np.int32),
        "nisland": np.zeros((1, steps), np.int32),
    }


def mean_work(counts: Counts, nv: int) -> float:
    """Return the work of a step: ``300 + 25 nv + nJ (1 + iterations)``, the mean over some steps.

    The constraints' Jacobian has ``nJ`` numbers, and each iteration of the solver goes through them, of which
    there are so many in the mean over islands. In fifteen models, from one sphere to a heap of two hundred,
    with Newton, CG and PGS, a unit took 7 to 22 ns.

    Args:
        counts: what was counted in the steps.
        nv: degrees of freedom.
    """
    islands = np.clip(counts["nisland"], 1, mujoco.mjNISLAND)  # MuJoCo tells the iterations of so many
    iterations = counts["solver_niter"].sum(axis=-1) / islands
    return float(_empty(nv) + (counts["nJ"] * (1.0 + iterations)).mean())


def resting_work(batch: Batch, model: mujoco.MjModel, keyframe: int) -> float:
    """Return the work of a step of standing still in a keyframe under its targets."""
    counts = counters(_REST_STEPS)
    batch.set_models(model)
    batch.reset(keyframe=keyframe, stage=mujoco.mjtStage.mjSTAGE_NONE)
    try:
        batch.rollout(_REST_STEPS, record=tuple(counts), out=counts)
    except SimulationError:  # as any gait will, which then says so
        return _empty(model.nv)
    return mean_work(counts, model.nv)


def _empty(nv: int) -> float:
    """Return the work of a step without constraints."""
    return _EMPTY_STEP + _PER_DOF * nv
