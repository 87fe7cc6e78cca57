"""CMA-ES: the global search. In ten dimensions it needs at least a few hundred evaluations.

Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772; restarts with doubled populations
after Auger and Hansen, "A Restart CMA Evolution Strategy With Increasing Population Size", 2005.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gaitopt.core.streams import Stream
from gaitopt.optimise.solvers.solution import Point, Solution, Stop
from gaitopt.optimise.solvers.solver import Choose, Minimisation


@dataclass(frozen=True)
class CmaEs:
    """CMA-ES with restarts.

    Attributes:
        offered: candidates on offer for each one that is evaluated, where there is something to choose by.
        restarts: how many further runs may follow the first.
    """

    offered: int = 3
    restarts: int = 100

    name: ClassVar[str] = "cma-es"
    stream: ClassVar[Stream] = Stream.CMA_ES
    ranks_populations: ClassVar[bool] = True

    def minimise(self, task: Minimisation) -> Solution:
        """Search from the start until the budget is spent; the last population is cut to fit.

        When a run has converged, the next one starts at a random point with twice the population.
        """
        box, rng, x0 = task.box, task.rng, task.x0
        best, best_cost, spent, population = x0, np.inf, 0, 4 + int(3 * np.log(box.dimension))
        for _ in range(self.restarts + 1):
            strategy = _strategy(task, x0, population)
            while not strategy.stop():
                candidates = self._population(strategy, population, task.choose)[: task.budget - spent]
                costs = task.evaluate(candidates)
                spent += len(candidates)
                if costs.min() < best_cost:
                    best, best_cost = candidates[costs.argmin()], float(costs.min())
                if spent >= task.budget:
                    return Solution(best, best_cost, spent, Stop.BUDGET)
                strategy.tell(list(candidates), costs.tolist())
            x0, population = rng.uniform(size=box.dimension), 2 * population
        return Solution(best, best_cost, spent, Stop.CONVERGED)

    def _population(self, strategy: Any, count: int, choose: Choose | None) -> Point:
        if choose is None:
            return np.array(strategy.ask())
        return choose(np.array(strategy.ask(self.offered * count)), count)


def _strategy(task: Minimisation, x0: Point, population: int) -> Any:
    import cma

    options = {
        "bounds": [_walls(task.box.low), _walls(task.box.high)],
        "popsize": population,
        "randn": lambda *shape: task.rng.standard_normal(shape),
        "seed": np.nan,
        "verbose": -9,
        "verb_log": 0,
        "signals_filename": None,  # it would be read in the current folder, and could end the search
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pycma warns about its own checks of options
        return cma.CMAEvolutionStrategy(x0, task.spread, options)


def _walls(bounds: Point) -> list[float | None]:
    return [float(b) if np.isfinite(b) else None for b in bounds]
