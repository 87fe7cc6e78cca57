"""Nelder–Mead: a local polish. Alone, in ten dimensions, it stops far from the best gait.

Nelder and Mead, "A simplex method for function minimization", 1965, with the coefficients adapted to
the dimension of Gao and Han, 2012, as SciPy has them.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize

from gaitopt.optimise.solvers.solution import Box, Evaluate, Point, Solution, Stop


def minimise(
    evaluate: Evaluate, box: Box, x0: Point, sigma: float, budget: int, rng: np.random.Generator
) -> Solution:
    """Polish `x0` with a simplex whose edges are `sigma` long, until it shrinks or the budget is spent.

    Args:
        evaluate: costs of points; called with one at a time.
        box: bounds and circular coordinates.
        x0: where to start, shape (d,).
        sigma: length of the first simplex's edges, in units of the box.
        budget: evaluations allowed.
        rng: draws the directions of the edges.
    """
    best, best_cost, spent = x0, np.inf, 0

    def cost(x: Point) -> float:
        nonlocal best, best_cost, spent
        value = float(evaluate(x[None])[0])
        spent += 1
        if value < best_cost:
            best, best_cost = x.copy(), value
        return value

    result = optimize.minimize(
        cost,
        x0,
        method="Nelder-Mead",
        bounds=optimize.Bounds(box.low, box.high),
        options={
            "initial_simplex": _simplex(box, x0, sigma, rng),
            "maxfev": budget,
            "xatol": 1e-4,
            "fatol": 1e-8,
            "adaptive": True,
        },
    )
    stop = Stop.CONVERGED if result.status == 0 else Stop.BUDGET
    return Solution(best, best_cost, spent, stop)


def _simplex(box: Box, x0: Point, sigma: float, rng: np.random.Generator) -> Point:
    """Return x0 and one further point along each axis, to a random side but never out of the box."""
    edges = sigma * rng.choice([-1.0, 1.0], size=box.dimension)
    outside = (x0 + edges < box.low) | (x0 + edges > box.high)
    edges = np.where(outside, -edges, edges)
    return np.vstack([x0, x0 + np.diag(edges)])
