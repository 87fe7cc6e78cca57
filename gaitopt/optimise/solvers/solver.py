"""What every solver is: a name, a random stream, and one call that minimises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gaitopt.core.streams import Stream, generator
from gaitopt.optimise.solvers.solution import Box, Evaluate, Point, Solution

Choose = Callable[[Point, int], Point]
"""Which candidates to evaluate, shape (count, d), of the candidates on offer, shape (n, d)."""


@dataclass(frozen=True)
class Minimisation:
    """The task of a solver.

    Attributes:
        evaluate: costs of candidate points.
        box: bounds and circular coordinates.
        x0: where to start, shape (d,).
        spread: length of the first steps, in units of the box.
        budget: evaluations allowed, at least 1.
        rng: source of all randomness.
        choose: chooses which candidates of a larger set to evaluate; None to evaluate every candidate. A
            solver may ignore it.
    """

    evaluate: Evaluate
    box: Box
    x0: Point
    spread: float
    budget: int
    rng: np.random.Generator
    choose: Choose | None = None


class Solver(Protocol):
    """An optimiser with its settings. To add one, write it and add it to `registry.SOLVERS`."""

    @property
    def name(self) -> str:
        """What ``--method`` and the journal call it."""
        ...

    @property
    def stream(self) -> Stream:
        """Its random stream; `Stream.SOLVER` for a solver without a separate stream."""
        ...

    @property
    def ranks_populations(self) -> bool:
        """Whether it only compares costs within one population.

        If so, gaits of a population may be dropped early, and a cheaper rung may judge a population.
        """
        ...

    def minimise(self, task: Minimisation) -> Solution:
        """Search until the budget is spent, or until the solver has converged."""
        ...


def draws(solver: Solver, seed: int) -> np.random.Generator:
    """Return the random numbers of a solver in a run.

    Solvers of `Stream.SOLVER` have different draws by their names, so a new solver changes no draw of
    others.
    """
    index = tuple(solver.name.encode()) if solver.stream is Stream.SOLVER else ()
    return generator(seed, solver.stream, *index)
