"""The recorder: evaluates candidates and writes each batch into the journal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.evaluator import Evaluated
from gaitopt.optimise.journal import WORKING, Entry, Journal, at_rung, ranked
from gaitopt.optimise.replay import Replay


@dataclass(frozen=True)
class SearchProgress(Progress):
    """A step of the search itself.

    Attributes:
        total: the budget.
        method: who proposed the last gaits.
        best: the best gait so far at the working fidelity.
        best_lower: the best one on the lower rung of the fidelity ladder that the search is on; None where it
            is at the working fidelity.
        simulated_s: simulated seconds so far.
    """

    total: int = 0
    method: str = ""
    best: Entry | None = None
    best_lower: Entry | None = None
    simulated_s: float = 0.0


SEARCH = "search"
"""Name of the stage."""

Judge = Callable[[Sequence[Gait]], list[Evaluated]]
"""Judges gaits: an `Evaluator`, or its race."""


class Recorder:
    """Evaluates candidates; takes those in the journal from it, and writes the others into it.

    Attributes:
        entries: the evaluations so far, in order.
    """

    def __init__(self, journal: Journal, space: GaitSpace, budget: int, on_progress: OnProgress = silent):
        self.entries: list[Entry] = []
        self._journal = journal
        self._replay = Replay(journal)
        self._space = space
        self._budget = budget
        self._on_progress = on_progress

    @property
    def best(self) -> Entry:
        """The best gait so far at the working fidelity: lowest cost, the earliest of equals."""
        return ranked(at_rung(self.entries))[0]

    def evaluate(
        self, method: str, points: NDArray[np.float64], judge: Judge, rung: str = WORKING
    ) -> NDArray[np.float64]:
        """Return the costs of candidates.

        Args:
            method: who proposes them.
            points: the candidates, shape (n, d).
            judge: judges their gaits.
            rung: rung of the fidelity ladder on which it judges them.

        Returns:
            Costs, shape (n,).

        Raises:
            GaitoptError: the journal has evaluations of another search.
        """
        batch = self._replay.answers(len(self.entries), points, method, rung)
        if len(batch) < len(points):  # the whole batch, because a population that races is judged together
            fresh = self._assess(method, points, judge, rung)[len(batch) :]
            self._journal.append(fresh)
            batch = batch + fresh
        self.entries += batch
        simulated = sum(entry.simulated_s for entry in self.entries)
        self._on_progress(
            SearchProgress(
                SEARCH,
                len(self.entries),
                self._budget,
                "gaits",
                method=method,
                best=self.best,
                best_lower=None if rung == WORKING else ranked(at_rung(self.entries, rung))[0],
                simulated_s=simulated,
            )
        )
        return np.array([entry.evaluation.cost for entry in batch])

    def check_journal(self) -> None:
        """Check, when the search is over, that the journal has no other evaluations.

        Raises:
            GaitoptError: it has.
        """
        self._replay.check_used(len(self.entries))

    def _assess(self, method: str, points: NDArray[np.float64], judge: Judge, rung: str) -> list[Entry]:
        first = len(self.entries)
        gaits = [self._space.decode(point, f"candidate-{first + i}") for i, point in enumerate(points)]
        return [
            Entry(first + i, method, points[i], gaits[i], one.evaluation, one.simulated_s, rung)
            for i, one in enumerate(judge(gaits))
        ]
