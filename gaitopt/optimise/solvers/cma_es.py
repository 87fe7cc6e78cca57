"""CMA-ES: the global search. Needs a few hundred evaluations in ten dimensions to pay.

Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772; restarts with doubled populations
after Auger and Hansen, "A Restart CMA Evolution Strategy With Increasing Population Size", 2005.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from gaitopt.optimise.solvers.solution import Box, Evaluate, Point, Solution, Stop

Choose = Callable[[Point, int], Point]
"""Which candidates to evaluate, shape (count, d), of those on offer, shape (n, d)."""

OFFERED = 3
"""Candidates on offer for each that is evaluated, where there is something to choose by."""


def minimise(
    evaluate: Evaluate,
    box: Box,
    x0: Point,
    sigma: float,
    budget: int,
    rng: np.random.Generator,
    choose: Choose | None = None,
    restarts: int = 100,
) -> Solution:
    """Search from `x0` with steps of about `sigma` until the budget is spent.

    When a run has converged the next one starts at a random point with twice the population.

    Args:
        evaluate: costs of a population.
        box: bounds and circular coordinates.
        x0: where to start, shape (d,).
        sigma: initial standard deviation, in units of the box.
        budget: evaluations allowed; the last population is cut to fit.
        rng: source of all randomness.
        choose: picks each population out of `OFFERED` times as many candidates; without it all are
            evaluated.
        restarts: how many further runs may follow the first.
    """
    import cma

    best, best_cost, spent, population = x0, np.inf, 0, 4 + int(3 * np.log(box.dimension))
    for _ in range(restarts + 1):
        options = {
            "bounds": [_walls(box.low), _walls(box.high)],
            "popsize": population,
            "randn": lambda *shape: rng.standard_normal(shape),
            "seed": np.nan,
            "verbose": -9,
            "verb_log": 0,
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pycma warns of its own option checks
            strategy = cma.CMAEvolutionStrategy(x0, sigma, options)
        while not strategy.stop():
            candidates = _population(strategy, population, choose)[: budget - spent]
            costs = evaluate(candidates)
            spent += len(candidates)
            if costs.min() < best_cost:
                best, best_cost = candidates[costs.argmin()], float(costs.min())
            if spent >= budget:
                return Solution(best, best_cost, spent, Stop.BUDGET)
            strategy.tell(list(candidates), costs.tolist())
        x0, population = rng.uniform(size=box.dimension), 2 * population
    return Solution(best, best_cost, spent, Stop.CONVERGED)


def _population(strategy: Any, count: int, choose: Choose | None) -> Point:
    if choose is None:
        return np.array(strategy.ask())
    return choose(np.array(strategy.ask(OFFERED * count)), count)


def _walls(bounds: Point) -> list[float | None]:
    return [float(b) if np.isfinite(b) else None for b in bounds]
