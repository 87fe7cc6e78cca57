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
from gaitopt.optimise.evaluator import Evaluator, simulated_s
from gaitopt.optimise.journal import Entry, at_rung, ranked
from gaitopt.optimise.notes import counted
from gaitopt.optimise.study import Start
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.simulation.setup import RobotSetup


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


def finalists(entries: Sequence[Entry], starts: Sequence[Start], count: int) -> list[Finalist]:
    """Return the best gaits of the search, and the best baseline in case none of them beats it.

    Args:
        entries: every evaluation of the search.
        starts: the baselines with their costs.
        count: how many gaits of the search.

    Raises:
        GaitoptError: every gait of the search failed.
    """
    leaders = [entry for entry in ranked(at_rung(entries)) if entry.evaluation.status == "ok"][:count]
    if not leaders:
        reasons = Counter(entry.evaluation.status for entry in entries)
        raise GaitoptError(f"every one of {len(entries)} gaits failed in simulation: {counted(reasons, 5)}")
    found = [Finalist(entry.gait, entry.method) for entry in leaders]
    if starts:
        baseline = min(starts, key=lambda start: start.cost).gait
        found.append(Finalist(baseline, baseline.name))
    return found


SELECTION = "selection"
"""Name of the stage."""


def select(
    problem: Problem,
    among: Sequence[Finalist],
    executor: Executor,
    seed: int,
    on_progress: OnProgress = silent,
) -> Selected:
    """Return the best of the finalists on fresh scenarios.

    The best gait of the search is partly best by chance on its few scenarios; fresh scenarios correct this.
    """
    scenarios = scenarios_of(problem, seed, Stream.SELECTION_SCENARIOS)
    setup = RobotSetup.of(problem, scenarios, problem.simulation.working)
    count = Count(on_progress, SELECTION, len(among) * len(scenarios), "rollouts")
    evaluator = Evaluator(setup, executor, problem.objective.search_margin, on_done=count.one)
    judged = evaluator([one.gait for one in among])
    costs = [one.evaluation.cost for one in judged]
    winner = among[costs.index(min(costs))]
    gait = Gait(winner.gait.period_s, winner.gait.channels, "best")
    return Selected(gait, winner.found_by, simulated_s(judged))
