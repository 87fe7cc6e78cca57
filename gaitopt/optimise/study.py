"""The study: a quasi-random first batch, CMA-ES, Nelder–Mead, one budget, one journal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from gaitopt.errors import GaitoptError, nearest
from gaitopt.gait import Gait
from gaitopt.optimise import cma_es, nelder_mead, pareto, surrogate
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.solution import Box
from gaitopt.space import GaitSpace

METHODS = ("default", "cma-es", "nelder-mead")

_FIRST, _FIRST_MOST = 0.1, 40
"""Share of the budget that the default method spends on a quasi-random first batch, and gaits at most."""

_POLISH = 0.15
"""Share of the budget that the default method leaves to Nelder–Mead; the rest is CMA-ES's."""

_SPREAD = 0.1
"""First standard deviation of a cold search, in units of the box."""

_PLANNED_SPREAD = 0.05
"""The same where a plan says where to start."""

_FRONT_SPREAD = 0.1
"""The same where a gait of the front is looked for from its best neighbour."""

_PARETO_STREAM = 16
"""Streams of randomness from here on belong to the front."""

_RACES = ("cma-es",)
"""Methods that rank a population, so that clear losers can be dropped early (see `Evaluator.race`)."""

_POLISH_EDGE = 0.05
"""Edge of Nelder–Mead's first simplex as a polish."""


@dataclass(frozen=True)
class Progress:
    """What a progress display needs to know."""

    done: int
    budget: int
    method: str
    best: Entry | None
    simulated_s: float


class Study:
    """One search: proposes gaits, evaluates them, keeps the journal."""

    def __init__(
        self,
        evaluator: Evaluator,
        journal: Journal,
        budget: int,
        seed: int,
        on_progress: Callable[[Progress], None] = lambda progress: None,
    ):
        if budget < 1:
            raise GaitoptError(f"--budget: found {budget}; allowed: 1 or more")
        self.evaluator = evaluator
        self.journal = journal
        self.budget = self._until = budget
        self.seed = seed
        self.entries: list[Entry] = []
        self._space = evaluator.setting.problem.space
        self._recorded = list(journal.entries)
        self._on_progress = on_progress

    @property
    def best(self) -> Entry:
        """The best gait so far: lowest cost, the earliest of equals."""
        return min(self.entries, key=lambda entry: (entry.evaluation.cost, entry.index))

    def run(
        self,
        method: str,
        starts: Sequence[tuple[Gait, float]] = (),
        planned: Sequence[Gait] = (),
        front: bool = False,
    ) -> Entry:
        """Spend the budget and return the best gait.

        Args:
            method: one of `METHODS`.
            starts: gaits whose cost is already known, such as the baselines.
            planned: gaits of a plan, evaluated first; without them a quasi-random batch is.
            front: spend `pareto.SHARE` of the budget on speed against cost of transport, after the rest.

        Raises:
            GaitoptError: there is no such method.
        """
        if method not in METHODS:
            allowed = f"{', '.join(METHODS)}{nearest(method, METHODS)}"
            raise GaitoptError(f"--method: found {method!r}; allowed: {allowed}")
        self._until = self.budget - (round(pareto.SHARE * self.budget) if front else 0)
        known = [(self._space.encode(gait), cost) for gait, cost in starts]
        if planned:
            points = np.array([self._space.encode(gait) for gait in planned])[: self._left]
            known += self._known("plan", points)
        elif method == "default":
            count = min(max(1, round(_FIRST * self._until)), _FIRST_MOST)
            known += self._known("quasi-random", quasi_random(self._space, count, self.seed))
        ranked = [point for point, _ in sorted(known, key=lambda pair: pair[1])]
        start = ranked[0] if ranked else np.full(len(self._space.variables), 0.5)
        spread = _PLANNED_SPREAD if planned else _SPREAD
        if method == "nelder-mead":
            self._polish(start, self._left, spread)
        elif method == "cma-es":
            self._search(start, self._left, spread)
        else:
            self._search(start, self._left - round(_POLISH * self._until), spread)
            self._polish(self.best.point, self._left, _POLISH_EDGE)
        self._until = self.budget
        if front:
            self._spread_front()
        return self.best

    @property
    def _left(self) -> int:
        return self._until - len(self.entries)

    def _spread_front(self) -> None:
        """Look for the cheapest gait, then for the fastest one under each of some limits of its cost.

        Where there is no front yet, and so no limit on it, the search for the cheapest gait goes on.
        """
        runs = 1 + pareto.LEVELS
        for index in range(runs):
            limits = pareto.limits(self.entries)
            aim = pareto.fastest_within(limits[index - 1]) if index and limits else pareto.cheapest
            self._pursue(aim, self._left // (runs - index), index)

    def _pursue(self, aim: pareto.Aim, budget: int, stream: int) -> None:
        """Search for another aim than the problem's, from the gait that so far serves it best."""
        if budget < 1:
            return

        def costs(points: NDArray[np.float64]) -> NDArray[np.float64]:
            self._evaluate("pareto", points)
            return np.array([aim(entry) for entry in self.entries[-len(points) :]])

        start = min(self.entries, key=aim).point
        rng = np.random.default_rng([self.seed, _PARETO_STREAM + stream])
        choose = self._chooser(aim)
        cma_es.minimise(costs, Box(self._space.circular), start, _FRONT_SPREAD, budget, rng, choose)

    def _known(self, method: str, points: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], float]]:
        return list(zip(points, self._evaluate(method, points).tolist(), strict=True))

    def _search(self, x0: NDArray[np.float64], budget: int, sigma: float) -> None:
        if budget > 0:
            rng = np.random.default_rng([self.seed, METHODS.index("cma-es")])
            box = Box(self._space.circular)
            choose = self._chooser(lambda entry: entry.evaluation.cost)
            cma_es.minimise(lambda x: self._evaluate("cma-es", x), box, x0, sigma, budget, rng, choose)

    def _chooser(self, aim: pareto.Aim) -> cma_es.Choose:
        """Return what picks candidates by all that was evaluated so far."""

        def choose(candidates: NDArray[np.float64], count: int) -> NDArray[np.float64]:
            points = np.array([entry.point for entry in self.entries]).reshape(-1, candidates.shape[1])
            costs = np.array([aim(entry) for entry in self.entries])
            return surrogate.most_promising(points, costs, candidates, count, self._space.circular)

        return choose

    def _polish(self, x0: NDArray[np.float64], budget: int, edge: float) -> None:
        if budget > 0:
            rng = np.random.default_rng([self.seed, METHODS.index("nelder-mead")])
            box = Box(self._space.circular)
            nelder_mead.minimise(lambda x: self._evaluate("nelder-mead", x), box, x0, edge, budget, rng)

    def _evaluate(self, method: str, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the costs of candidates, from the journal where it has them."""
        replayed: list[Entry] = []
        for point in points[: max(0, len(self._recorded) - len(self.entries))]:
            entry = self._recorded[len(self.entries) + len(replayed)]
            if not np.array_equal(entry.point, point):
                raise GaitoptError(
                    f"{self.journal.path}: evaluation {entry.index} is not the one that this seed, budget "
                    "and method propose; the run was made by other ones or by another version"
                )
            replayed.append(entry)
        fresh: list[Entry] = []
        if len(replayed) < len(points):  # whole: a population that races is judged together
            fresh = self._assess(method, points, len(self.entries))[len(replayed) :]
            self.journal.append(fresh)
        self.entries += replayed + fresh
        self._on_progress(
            Progress(
                len(self.entries), self.budget, method, self.best, sum(e.simulated_s for e in self.entries)
            )
        )
        return np.array([entry.evaluation.cost for entry in replayed + fresh])

    def _assess(self, method: str, points: NDArray[np.float64], first: int) -> list[Entry]:
        gaits = [self._space.decode(point, f"candidate-{first + i}") for i, point in enumerate(points)]
        judged = self.evaluator.race(gaits) if method in _RACES else self.evaluator(gaits)
        entries = []
        for i, (evaluation, outcomes) in enumerate(judged):
            simulated = sum(outcome.simulated_s for outcome in outcomes)
            entries.append(Entry(first + i, method, points[i], gaits[i], evaluation, simulated))
        return entries


def quasi_random(space: GaitSpace, count: int, seed: int) -> NDArray[np.float64]:
    """Return scrambled Sobol points of the unit box, shape (count, d)."""
    sampler = qmc.Sobol(len(space.variables), rng=np.random.default_rng([seed, len(METHODS)]))
    points: NDArray[np.float64] = sampler.random_base2(max(0, (count - 1).bit_length()))
    return points[:count]
