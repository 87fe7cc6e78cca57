"""The selection of the winner among the best gaits of a search, on scenarios that the search did not see."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import Count, OnProgress, silent
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.evaluator import Evaluator, Outcome, judge
from gaitopt.optimise.journal import Entry, succeeded
from gaitopt.optimise.notes import counted
from gaitopt.optimise.solvers.surrogate import distance
from gaitopt.optimise.study import Start
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.setup import RobotSetup

_GROUPS = 4
"""How many times as many others as leaders are tried, until one keeps every limit.

Few scenarios flatter the best of many gaits: in ArcFold the drift over three of them has a standard deviation
of a third of its limit."""

_UNLIKE = 0.1
"""Gaits are unlike if they are so far apart in the gait space, of which each coordinate is 1 wide."""


@dataclass(frozen=True)
class Finalist:
    """A gait that may win.

    Attributes:
        gait: the gait.
        found_by: the method, or the baseline, that it comes from.
    """

    gait: Gait
    found_by: str


@dataclass(frozen=True)
class Selected:
    """The winner among the finalists.

    Attributes:
        gait: the winner, called ``best``.
        found_by: the method, or the baseline, that it comes from.
        simulated_s: simulated seconds that the selection took.
    """

    gait: Gait
    found_by: str
    simulated_s: float


@dataclass(frozen=True)
class Finalists:
    """Gaits that may win.

    Attributes:
        leaders: the best gaits of the search.
        others: further gaits, best first, each unlike all before it: those in case all leaders break a limit.
        baseline: the best baseline, in case none of them beats it.
    """

    leaders: Sequence[Finalist]
    others: Sequence[Finalist] = ()
    baseline: Finalist | None = None

    @property
    def groups(self) -> list[Sequence[Finalist]]:
        """The leaders, and then the others, as many at a time."""
        size = max(1, len(self.leaders))
        starts = range(0, len(self.others), size)
        return [self.leaders, *(self.others[start : start + size] for start in starts)]


def unlike(
    entries: Sequence[Entry], count: int, space: GaitSpace, before: Sequence[Entry] = ()
) -> list[Entry]:
    """Return the first evaluations whose gaits are unlike each other.

    Args:
        entries: the evaluations, the best first.
        count: how many, at most.
        space: the gait space.
        before: evaluations that all of them are unlike, too.
    """
    found: list[Entry] = []
    for entry in entries:
        apart = (distance(entry.point, one.point, space.circular) for one in (*before, *found))
        if len(found) < count and all(far > _UNLIKE for far in apart):
            found.append(entry)
    return found


def finalists(entries: Sequence[Entry], starts: Sequence[Start], count: int, space: GaitSpace) -> Finalists:
    """Return the gaits of a search that may win.

    Args:
        entries: every evaluation of the search.
        starts: the baselines with their costs.
        count: how many leaders; there are `_GROUPS` times as many others at most.
        space: the gait space.

    Raises:
        GaitoptError: every gait of the search failed.
    """
    good = succeeded(entries)
    if not good:
        reasons = Counter(entry.evaluation.status for entry in entries)
        raise GaitoptError(f"every one of {len(entries)} gaits failed in simulation: {counted(reasons, 5)}")
    leaders, others = good[:count], unlike(good[count:], _GROUPS * count, space, good[:count])
    baseline = min(starts, key=lambda start: start.evaluation.cost, default=None)
    return Finalists(
        [Finalist(entry.gait, entry.method) for entry in leaders],
        [Finalist(entry.gait, entry.method) for entry in others],
        Finalist(baseline.gait, baseline.gait.name) if baseline else None,
    )


SELECTION, CONFIRMATION = "selection", "confirmation of the best"
"""Names of the stages. How many gaits the second one simulates is not known before."""


_Rank = tuple[bool, bool, float]
"""Whether a gait breaks a limit with its margin, whether it breaks one at all, and its cost."""


@dataclass
class _Candidate:
    """A finalist and its rank by the outcomes that it is judged by: the lowest is best."""

    finalist: Finalist
    rank: _Rank
    confirmed: bool = False

    @property
    def keeps_limits(self) -> bool:
        """Whether it keeps every limit, with its margin."""
        return not self.rank[0]


def select(
    problem: Problem,
    among: Finalists,
    executor: Executor,
    seed: int,
    on_progress: OnProgress = silent,
) -> Selected:
    """Return the best of the finalists on fresh scenarios.

    The best gait of the search is partly best by chance on its few scenarios; fresh scenarios correct this.
    Its leaders are often alike, the last steps to one optimum. While all that were tried break a limit, the
    others are tried, too. A gait that keeps every limit wins over one that breaks some, whatever it costs.
    The best of many is again best by chance, and at the working fidelity. So it must stay the best where it
    is judged anew, at the reference fidelity in other scenarios.
    """
    trials = _Trials(problem, executor, seed, on_progress)
    baselines = [among.baseline] if among.baseline else []
    first = trials.judged([*among.leaders, *baselines], SELECTION)
    trials.enter(first[: len(among.leaders)])
    further = iter(among.groups[1:])
    while not trials.settled() and (group := next(further, None)):
        trials.enter(trials.judged(group, CONFIRMATION))
    trials.enter(first[len(among.leaders) :])
    while not trials.best.confirmed:
        trials.confirm()
    winner = trials.best.finalist
    gait = Gait(winner.gait.period_s, winner.gait.channels, "best")
    return Selected(gait, winner.found_by, trials.simulated_s)


class _Trials:
    """The finalists that were simulated so far.

    Attributes:
        simulated_s: simulated seconds of all.
    """

    def __init__(self, problem: Problem, executor: Executor, seed: int, on_progress: OnProgress):
        self._problem = problem
        self._executor = executor
        self._seed = seed
        self._on_progress = on_progress
        self._candidates: list[_Candidate] = []
        self.simulated_s = 0.0
        self._count: Count | None = None

    @property
    def best(self) -> _Candidate:
        """The best by all that is known of each: the earliest of equals."""
        return min(self._candidates, key=lambda one: one.rank)

    def settled(self) -> bool:
        """Confirm the best while it keeps every limit; return whether a confirmed one still keeps them."""
        while self.best.keeps_limits and not self.best.confirmed:
            self.confirm()
        return self.best.keeps_limits

    def judged(self, group: Sequence[Finalist], stage: str) -> list[_Candidate]:
        """Simulate further finalists, and return them."""
        rows = self._outcomes(group, Stream.SELECTION_SCENARIOS, self._problem.simulation.working, stage)
        return [_Candidate(one, self._rank(row)) for one, row in zip(group, rows, strict=True)]

    def enter(self, candidates: Sequence[_Candidate]) -> None:
        """Let further finalists compete."""
        self._candidates += candidates

    def confirm(self) -> None:
        """Judge the best anew: where it was chosen, it was flattered."""
        best, reference = self.best, self._problem.simulation.reference
        (row,) = self._outcomes([best.finalist], Stream.CONFIRMATION_SCENARIOS, reference, CONFIRMATION)
        best.rank, best.confirmed = self._rank(row), True

    def _outcomes(
        self, group: Sequence[Finalist], stream: Stream, fidelity: Fidelity, stage: str
    ) -> list[list[Outcome]]:
        scenarios = scenarios_of(self._problem, self._seed, stream)
        setup = RobotSetup.of(self._problem, scenarios, fidelity)
        if self._count is None or self._count.stage != stage:
            total = len(group) * len(scenarios) if stage == SELECTION else None
            self._count = Count(self._on_progress, stage, total, "rollouts")
        gaits = [one.gait for one in group]
        rows = Evaluator(setup, self._executor, on_done=self._count.one).outcomes(gaits)
        self.simulated_s += sum(outcome.simulated_s for row in rows for outcome in row)
        return rows

    def _rank(self, row: Sequence[Outcome]) -> _Rank:
        problem, margin = self._problem, self._problem.objective.search_margin
        strict, plain = (judge(problem, row, share) for share in (margin, 0.0))
        return not strict.constraints_met, not plain.constraints_met, strict.cost
