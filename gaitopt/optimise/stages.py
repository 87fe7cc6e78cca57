"""The methods of the search: each a list of stages that share the budget."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gaitopt.core.errors import GaitoptError, nearest
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.nelder_mead import NelderMead
from gaitopt.optimise.solvers.registry import SOLVERS
from gaitopt.optimise.solvers.solver import Solver


@dataclass(frozen=True)
class FirstBatch:
    """Quasi-random gaits before the first stage: all over the space, or near the gaits of a plan.

    Attributes:
        share: share of the budget without a plan.
        near_plan: share of the budget with one.
        most: gaits at most.
        slower: periods near a plan are up to so many times as long as planned.
    """

    share: float = 0.1
    near_plan: float = 0.2
    most: int = 40
    slower: float = 4.0

    def count(self, budget: int, planned: bool = False) -> int:
        """Return how many gaits of a budget belong to it, at least 1."""
        return min(max(1, round((self.near_plan if planned else self.share) * budget)), self.most)


@dataclass(frozen=True)
class Stage:
    """One solver at work.

    Attributes:
        solver: the solver.
        share: share of the budget that the stages before leave for this one. It may also spend what they
            left over.
        spread: length of the first steps, in units of the box; None for that of the settings, which depends
            on whether there is a plan.
        from_search: whether it starts from the best gait of the search, not from the best of the baselines
            and the first gaits.
        may_descend: whether a cheaper rung of the fidelity ladder may judge its populations. The best
            gaits of that rung are then evaluated again at the working fidelity.
        tied: whether it searches only gaits that obey the problem's ties.
        freed: whether it goes on without the ties, with random numbers of its own.
    """

    solver: Solver
    share: float = 0.0
    spread: float | None = None
    from_search: bool = False
    may_descend: bool = False
    tied: bool = False
    freed: bool = False


@dataclass(frozen=True)
class Method:
    """How to search.

    Attributes:
        name: what ``--method`` calls it.
        stages: the solvers in order.
        first: the batch before them, after the gaits of a plan; None for none.
    """

    name: str
    stages: tuple[Stage, ...]
    first: FirstBatch | None = None


DEFAULT_METHOD = Method(
    "default",
    (
        Stage(CmaEs(), may_descend=True),
        Stage(NelderMead(), share=0.15, spread=0.05, from_search=True),
    ),
    FirstBatch(),
)
"""CMA-ES from a quasi-random batch or a plan and a batch near it, then a polish by Nelder–Mead."""


FREED_SHARE = 0.25
"""Share of the budget for the search without ties, where the problem file does not say it."""

_FREED_SPREAD = 0.05
"""Length of its first steps: it begins at a good gait."""


def with_ties(method: Method, freed_share: float | None) -> Method:
    """Return a method for a problem with ties: all its stages obey them, and then its first one is freed.

    Args:
        method: the method.
        freed_share: share of the budget for the freed stage; `FREED_SHARE` by default.
    """
    share = FREED_SHARE if freed_share is None else freed_share
    stages = tuple(replace(stage, tied=True) for stage in method.stages)
    if share > 0.0:
        freed = replace(
            stages[0], share=share, spread=_FREED_SPREAD, from_search=True, tied=False, freed=True
        )
        stages = (*stages, freed)
    return replace(method, stages=stages, first=method.first or FirstBatch())


def method_names() -> list[str]:
    """Return the names that ``--method`` allows: the default search, and each solver by itself."""
    return [DEFAULT_METHOD.name, *SOLVERS]


def method_of(name: str) -> Method:
    """Return the method of a name.

    Raises:
        GaitoptError: there is no such method.
    """
    if name == DEFAULT_METHOD.name:
        return DEFAULT_METHOD
    if name not in SOLVERS:
        names = method_names()
        raise GaitoptError(f"--method: found {name!r}; allowed: {', '.join(names)}{nearest(name, names)}")
    return Method(name, (Stage(SOLVERS[name]),))
