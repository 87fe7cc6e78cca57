"""The study: a quasi-random first batch, CMA-ES, Nelder–Mead, one budget, one journal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from gaitopt.core.errors import GaitoptError, nearest
from gaitopt.core.interrupts import interrupts_held
from gaitopt.core.streams import Stream, generator
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise import ladder, pareto
from gaitopt.optimise.evaluator import Evaluated, Evaluator
from gaitopt.optimise.journal import WORKING, Entry, Journal, at_rung, ranked
from gaitopt.optimise.solvers import cma_es, nelder_mead, surrogate
from gaitopt.optimise.solvers.solution import Box

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

_LADDER_FROM = 300
"""Gaits of CMA-ES from which on cheaper rungs are measured; that costs as much as 15 gaits at most."""

_CLIMBERS = 5
"""Gaits that led on a lower rung and are judged again at the working fidelity."""

LOWER = "lower"
"""The rung of what was judged below the working fidelity; `Study.rungs` says how far below."""

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


Judge = Callable[[Sequence[Gait]], list[Evaluated]]
"""What judges gaits: an `Evaluator`, or its race."""


class Study:
    """One search: proposes gaits, evaluates them, keeps the journal.

    Attributes:
        rungs: the cheaper rungs that were measured, and whether the search went on with them.
    """

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
        self.rungs: list[ladder.Rung] = []
        self._lowest = evaluator
        self._space = evaluator.setup.problem.space
        self._recorded = list(journal.entries)
        self._on_progress = on_progress

    @property
    def best(self) -> Entry:
        """The best gait so far at the working fidelity: lowest cost, the earliest of equals."""
        return ranked(at_rung(self.entries))[0]

    def run(
        self,
        method: str,
        starts: Sequence[tuple[Gait, float]] = (),
        planned: Sequence[Gait] = (),
        front: bool = False,
        laddered: bool = False,
    ) -> Entry:
        """Spend the budget and return the best gait.

        Args:
            method: one of `METHODS`.
            starts: gaits whose cost is already known, such as the baselines.
            planned: gaits of a plan, evaluated first; without them a quasi-random batch is.
            front: spend `pareto.SHARE` of the budget on speed against cost of transport, after the rest.
            laddered: CMA-ES of the default method may go on at a lower fidelity (see `ladder`); what leads
                there is judged again. Not with a front, which is made of all gaits.

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
            self._search(start, self._left - round(_POLISH * self._until), spread, laddered and not front)
            self._climb()
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
            self._evaluate("pareto", points, self.evaluator)
            return np.array([aim(entry) for entry in self.entries[-len(points) :]])

        start = min(self.entries, key=aim).point
        rng = generator(self.seed, Stream.FRONT + stream)
        choose = self._chooser(aim)
        cma_es.minimise(costs, Box(self._space.circular), start, _FRONT_SPREAD, budget, rng, choose)

    def _known(self, method: str, points: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], float]]:
        return list(zip(points, self._evaluate(method, points, self.evaluator).tolist(), strict=True))

    def _search(self, x0: NDArray[np.float64], budget: int, sigma: float, laddered: bool = False) -> None:
        if budget > 0:
            rng = generator(self.seed, Stream.CMA_ES)
            box = Box(self._space.circular)
            choose = self._chooser(lambda entry: entry.evaluation.cost)
            costs = self._descending if laddered and budget >= _LADDER_FROM else self._raced
            cma_es.minimise(costs, box, x0, sigma, budget, rng, choose)

    def _raced(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._evaluate("cma-es", points, self._lowest.race, self._rung)

    def _descending(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the costs of a population, which CMA-ES compares with no other one's.

        Those of the first population are the working fidelity's, and cheaper rungs are measured by them.
        """
        if self.rungs:
            return self._raced(points)
        costs = self._evaluate("cma-es", points, self.evaluator)
        gaits = [entry.gait for entry in self.entries[-len(points) :]]
        self._lowest, self.rungs = ladder.descended(self.evaluator, gaits, costs)
        return costs

    def _climb(self) -> None:
        """Judge at the working fidelity what leads on a lower rung."""
        lower = [e for e in ranked(at_rung(self.entries, LOWER)) if e.evaluation.status == "ok"]
        points = [entry.point for entry in lower[: min(_CLIMBERS, self._left)]]
        if points:
            self._evaluate("cma-es", np.array(points), self.evaluator)

    @property
    def _rung(self) -> str:
        return WORKING if self._lowest is self.evaluator else LOWER

    def _chooser(self, aim: pareto.Aim) -> cma_es.Choose:
        """Return what picks candidates by all that was evaluated so far on the rung that judges them."""

        def choose(candidates: NDArray[np.float64], count: int) -> NDArray[np.float64]:
            known = at_rung(self.entries, self._rung)
            points = np.array([entry.point for entry in known]).reshape(-1, candidates.shape[1])
            costs = np.array([aim(entry) for entry in known])
            return surrogate.most_promising(points, costs, candidates, count, self._space.circular)

        return choose

    def _polish(self, x0: NDArray[np.float64], budget: int, edge: float) -> None:
        if budget > 0:
            rng = generator(self.seed, Stream.NELDER_MEAD)
            box = Box(self._space.circular)
            nelder_mead.minimise(self._polished, box, x0, edge, budget, rng)

    def _polished(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._evaluate("nelder-mead", points, self.evaluator)

    def _evaluate(
        self, method: str, points: NDArray[np.float64], judge: Judge, rung: str = WORKING
    ) -> NDArray[np.float64]:
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
            fresh = self._assess(method, points, judge, rung)[len(replayed) :]
            self.journal.append(fresh)
        self.entries += replayed + fresh
        self._on_progress(
            Progress(
                len(self.entries), self.budget, method, self.best, sum(e.simulated_s for e in self.entries)
            )
        )
        return np.array([entry.evaluation.cost for entry in replayed + fresh])

    def _assess(self, method: str, points: NDArray[np.float64], judge: Judge, rung: str) -> list[Entry]:
        first = len(self.entries)
        gaits = [self._space.decode(point, f"candidate-{first + i}") for i, point in enumerate(points)]
        entries = []
        for i, one in enumerate(judge(gaits)):
            entries.append(
                Entry(first + i, method, points[i], gaits[i], one.evaluation, one.simulated_s, rung)
            )
        return entries


def quasi_random(space: GaitSpace, count: int, seed: int) -> NDArray[np.float64]:
    """Return scrambled Sobol points of the unit box, shape (count, d)."""
    with interrupts_held():  # which reading its table would lose
        sampler = qmc.Sobol(len(space.variables), rng=generator(seed, Stream.QUASI_RANDOM))
    points: NDArray[np.float64] = sampler.random_base2(max(0, (count - 1).bit_length()))
    return points[:count]
