"""The study: a quasi-random first batch, CMA-ES, Nelder–Mead, one budget, one journal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from gaitopt.errors import GaitoptError, nearest
from gaitopt.gait import Gait
from gaitopt.optimise import cma_es, nelder_mead
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.solution import Box

METHODS = ("default", "cma-es", "nelder-mead")

_SPREAD = 0.2
"""First standard deviation of CMA-ES, in units of the box."""

_POLISH_EDGE = 0.05
"""Edge of Nelder–Mead's first simplex as a polish, and `_SPREAD` where it searches alone."""


@dataclass(frozen=True)
class Shares:
    """How the default method spends its budget; the rest is CMA-ES's."""

    first: float = 0.1
    polish: float = 0.15


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
        self.budget = budget
        self.seed = seed
        self.entries: list[Entry] = []
        self._space = evaluator.setting.problem.space
        self._recorded = list(journal.entries)
        self._on_progress = on_progress

    @property
    def best(self) -> Entry:
        """The best gait so far: lowest cost, the earliest of equals."""
        return min(self.entries, key=lambda entry: (entry.evaluation.cost, entry.index))

    def run(self, method: str, starts: Sequence[tuple[Gait, float]]) -> Entry:
        """Spend the budget and return the best gait.

        Args:
            method: one of `METHODS`.
            starts: gaits whose cost is already known, such as the baselines.

        Raises:
            GaitoptError: there is no such method.
        """
        if method not in METHODS:
            allowed = f"{', '.join(METHODS)}{nearest(method, METHODS)}"
            raise GaitoptError(f"--method: found {method!r}; allowed: {allowed}")
        box = Box(self._space.circular)
        known = [(self._space.encode(gait), cost) for gait, cost in starts]
        if method == "default":
            shares = Shares()
            first = max(1, round(shares.first * self.budget))
            polish = round(shares.polish * self.budget)
            points = self._quasi_random(first)
            known += list(zip(points, self._evaluate("quasi-random", points).tolist(), strict=True))
            self._search("cma-es", box, _lowest(known), self.budget - first - polish)
            self._search("nelder-mead", box, self.best.point, self.budget - len(self.entries), _POLISH_EDGE)
        else:
            start = _lowest(known) if known else np.full(box.dimension, 0.5)
            self._search(method, box, start, self.budget)
        return self.best

    def _search(
        self, method: str, box: Box, x0: NDArray[np.float64], budget: int, sigma: float = _SPREAD
    ) -> None:
        if budget < 1:
            return
        rng = np.random.default_rng([self.seed, METHODS.index(method)])
        optimiser = {"cma-es": cma_es, "nelder-mead": nelder_mead}[method]
        optimiser.minimise(lambda points: self._evaluate(method, points), box, x0, sigma, budget, rng)

    def _quasi_random(self, count: int) -> NDArray[np.float64]:
        sampler = qmc.Sobol(len(self._space.variables), rng=np.random.default_rng([self.seed, len(METHODS)]))
        points: NDArray[np.float64] = sampler.random_base2(max(0, (count - 1).bit_length()))
        return points[:count]

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
        fresh = self._assess(method, points[len(replayed) :], len(self.entries) + len(replayed))
        if fresh:
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
        entries = []
        for i, (evaluation, outcomes) in enumerate(self.evaluator(gaits)):
            simulated = sum(outcome.simulated_s for outcome in outcomes)
            entries.append(Entry(first + i, method, points[i], gaits[i], evaluation, simulated))
        return entries


def _lowest(known: Sequence[tuple[NDArray[np.float64], float]]) -> NDArray[np.float64]:
    return min(known, key=lambda pair: pair[1])[0]
