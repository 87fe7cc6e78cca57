"""The work of a simulation, in counts: with a clock, results would depend on the machine's speed."""

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


class WorkBudget:
    """The work that a rollout may still take, estimated from the counts of some of its steps."""

    def __init__(self, allowed: float, chunk: int, every: int, nv: int):
        """Allow an amount of work.

        Args:
            allowed: work, in the unit of `mean_work`.
            chunk: steps that are simulated at once, at most.
            every: one step in this many is counted, from the first one of a chunk.
            nv: degrees of freedom.
        """
        self._left, self._every, self._nv = allowed, every, nv
        self._counts = counters(chunk)

    def counters(self, steps: int) -> Counts:
        """Return arrays for the counts of the next steps."""
        return {name: array[:, :steps] for name, array in self._counts.items()}

    def spend(self, counts: Counts, steps: int) -> None:
        """Subtract the work of so many steps, by the counts of some of them."""
        some = {name: array[:, :: self._every] for name, array in counts.items()}
        self._left -= steps * mean_work(some, self._nv)

    @property
    def exceeded(self) -> bool:
        """Whether more work was done than allowed."""
        return self._left < 0.0


def counters(steps: int) -> Counts:
    """Return the arrays for the counts of a rollout of one simulation, each of shape (1, steps, ...)."""
    return {
        "nJ": np.zeros((1, steps), np.int32),
        "solver_niter": np.zeros((1, steps, mujoco.mjNISLAND), np.int32),
        "nisland": np.zeros((1, steps), np.int32),
    }


def mean_work(counts: Counts, nv: int) -> float:
    """Return the work of a step: ``300 + 25 nv + nJ (1 + iterations)``, the mean over some steps.

    The constraints' Jacobian has ``nJ`` numbers. Each iteration of the solver goes through all of them;
    iterations are averaged over islands. In fifteen models, from one sphere to a heap of two hundred, with
    Newton, CG and PGS, a unit took 7 to 22 ns.

    Args:
        counts: what was counted in the steps.
        nv: degrees of freedom.
    """
    # MuJoCo counts the iterations of at most mjNISLAND islands. (`np.clip` takes five times as long.)
    islands = np.minimum(np.maximum(counts["nisland"], 1), mujoco.mjNISLAND)
    iterations = counts["solver_niter"].sum(axis=-1) / islands
    return float(_empty(nv) + (counts["nJ"] * (1.0 + iterations)).mean())


def resting_work(batch: Batch, model: mujoco.MjModel, keyframe: int) -> float:
    """Return the work of a step of standing still in a keyframe under its targets."""
    counts = counters(_REST_STEPS)
    batch.set_models(model)
    batch.reset(keyframe=keyframe, stage=mujoco.mjtStage.mjSTAGE_NONE)
    try:
        batch.rollout(_REST_STEPS, record=tuple(counts), out=counts)
    except SimulationError:  # every gait will fail as well, and its status says why
        return _empty(model.nv)
    return mean_work(counts, model.nv)


def _empty(nv: int) -> float:
    """Return the work of a step without constraints."""
    return _EMPTY_STEP + _PER_DOF * nv
