"""The penalties during a search: breaking a limit costs only as much as it takes that gaits keep it.

A penalty that rules out every broken limit is larger than most differences in speed. Where it acts in full
from the beginning, a search follows the limit through a narrow valley, and chance in a drift hides what a
gait gains. So each penalty begins small, and grows while most of the better gaits break its limit. This is
the adaptive penalty of A. B. Hadj-Alouane and J. C. Bean, "A Genetic Algorithm for the Multiple-Choice
Integer Program", Operations Research 45, 1997, with one weight for each limit. The gain is in
``results/penalty``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.optimise.evaluator import DROPPED
from gaitopt.simulation.objective import Evaluation


@dataclass(frozen=True)
class PenaltySettings:
    """How penalties adapt.

    Attributes:
        first: share of its full penalty with which each limit begins.
        least: smallest share.
        factor: by what a share grows or shrinks after each population, up to the full penalty.
        parents: share of a population that decides: CMA-ES recombines its better half.
    """

    first: float = 0.2
    least: float = 0.02
    factor: float = 1.2
    parents: float = 0.5


class Penalty:
    """The share of its full penalty with which each limit counts at present.

    Only costs of one population may be compared: the next one may count in another way.

    Attributes:
        shares: the share of each constraint, from `PenaltySettings.least` to 1.
    """

    def __init__(
        self, full: float, constraints: Iterable[str], settings: PenaltySettings = PenaltySettings()
    ):
        """Begin a search.

        Args:
            full: cost of violating a constraint by its scale, as in `Objective.penalty`.
            constraints: names of the constraints.
            settings: how penalties adapt.
        """
        self.shares = dict.fromkeys(constraints, settings.first)
        self._full = full
        self._settings = settings

    def cost(self, evaluation: Evaluation) -> float:
        """Return the cost of a gait with the present penalties; that of a failed one stays as it is."""
        spared = sum((1.0 - self.shares[name]) * size for name, size in evaluation.violations.items())
        return evaluation.cost - self._full * spared

    def costs(self, population: Sequence[Evaluation]) -> NDArray[np.float64]:
        """Return the costs of a population, shape (n,), and then adapt the penalties to it.

        A gait that the race has dropped costs at least as much as the worst of the others.
        """
        costs = np.array([self.cost(one) for one in population])
        whole = np.array([one.status == "ok" for one in population])
        dropped = np.array([one.status.startswith(DROPPED) for one in population])
        if whole.any():
            costs[dropped] = np.maximum(costs[dropped], costs[whole].max())
            self._adapt([population[i] for i in np.argsort(costs, kind="stable") if whole[i]])
        return costs

    def _adapt(self, ranked: Sequence[Evaluation]) -> None:
        """Raise the penalty of each limit that most of the better gaits break, and lower the others."""
        settings = self._settings
        better = ranked[: max(1, round(settings.parents * len(ranked)))]
        for name, share in self.shares.items():
            broken = sum(one.violations.get(name, 0.0) > 0.0 for one in better)
            grown = share * settings.factor if 2 * broken > len(better) else share / settings.factor
            self.shares[name] = min(max(grown, settings.least), 1.0)
