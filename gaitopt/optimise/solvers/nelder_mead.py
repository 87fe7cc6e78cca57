"""Nelder–Mead: a local polish. Used alone in ten dimensions, it stops far from the best gait.

Nelder and Mead, "A simplex method for function minimization", 1965, with the coefficients adapted to
the dimension of Gao and Han, 2012, as SciPy has them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import optimize

from gaitopt.core.streams import Stream
from gaitopt.optimise.solvers.solution import Box, Point, Solution, Stop
from gaitopt.optimise.solvers.solver import Minimisation


@dataclass(frozen=True)
class NelderMead:
    """A simplex whose first edges are as long as the spread, to random sides.

    Attributes:
        step_tolerance: it has converged when the simplex is smaller than this, in units of the box, and
        cost_tolerance: the costs of its corners differ by less than this.
    """

    step_tolerance: float = 1e-4
    cost_tolerance: float = 1e-8

    name: ClassVar[str] = "nelder-mead"
    stream: ClassVar[Stream] = Stream.NELDER_MEAD
    ranks_populations: ClassVar[bool] = False

    def minimise(self, task: Minimisation) -> Solution:
        """Polish the start, one point at a time, until the simplex has shrunk or the budget is spent."""
        best, best_cost, spent = task.x0, np.inf, 0

        def cost(x: Point) -> float:
            nonlocal best, best_cost, spent
            value = float(task.evaluate(x[None])[0])
            spent += 1
            if value < best_cost:
                best, best_cost = x.copy(), value
            return value

        result = optimize.minimize(
            cost,
            task.x0,
            method="Nelder-Mead",
            bounds=optimize.Bounds(task.box.low, task.box.high),
            options={
                "initial_simplex": _simplex(task.box, task.x0, task.spread, task.rng),
                "maxfev": task.budget,
                "xatol": self.step_tolerance,
                "fatol": self.cost_tolerance,
                "adaptive": True,
            },
        )
        stop = Stop.CONVERGED if result.status == 0 else Stop.BUDGET
        return Solution(best, best_cost, spent, stop)


def _simplex(box: Box, x0: Point, edge: float, rng: np.random.Generator) -> Point:
    """Return x0 and one further point along each axis, to a random side, but inside the box."""
    edges = edge * rng.choice([-1.0, 1.0], size=box.dimension)
    outside = (x0 + edges < box.low) | (x0 + edges > box.high)
    edges = np.where(outside, -edges, edges)
    return np.vstack([x0, x0 + np.diag(edges)])
