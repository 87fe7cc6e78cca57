"""The main job: baselines, search, selection of the winner, verification."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from gaitopt.errors import GaitoptError
from gaitopt.gait import Gait
from gaitopt.objective import check_objective
from gaitopt.optimise.evaluator import Evaluator, Setting
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.study import Progress, Study
from gaitopt.optimise.verification import SEARCH, SELECTION, Verified, scenarios_of, verify
from gaitopt.problem import Problem

DEFAULT_BUDGET = 600

_FINALISTS = 5


@dataclass(frozen=True)
class Request:
    """What was asked for: with the problem, all that a result depends on."""

    seed: int = 1
    budget: int = DEFAULT_BUDGET
    method: str = "default"
    warm_start: bool = True


@dataclass(frozen=True)
class Optimised:
    """What the main job found.

    Attributes:
        request: what was asked for.
        entries: every evaluation of the search, in order.
        found_by: the method, or the baseline, that the winner comes from.
        best: the winner, verified.
        baselines: the hand-tuned gaits, verified.
        simulated_s: simulated seconds in all.
        wall_s: seconds it took.
    """

    request: Request
    entries: list[Entry]
    found_by: str
    best: Verified
    baselines: list[Verified]
    simulated_s: float
    wall_s: float


def optimise(
    problem: Problem,
    request: Request,
    journal: Journal,
    executor: Executor,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> Optimised:
    """Search for the best gait of a problem and verify it beside the baselines.

    Raises:
        GaitoptError: the request or the objective is wrong, or every gait failed.
    """
    began = time.monotonic()
    check_objective(problem)
    setting = Setting.of(problem, scenarios_of(problem, request.seed, SEARCH), problem.simulation.working)
    evaluator = Evaluator(setting, executor)
    study = Study(evaluator, journal, request.budget, request.seed, on_progress)
    names = list(problem.baselines)
    known = evaluator([problem.baselines[name] for name in names])
    starts = [
        (problem.baselines[n], evaluation.cost) for n, (evaluation, _) in zip(names, known, strict=True)
    ]
    study.run(request.method, starts)
    finalists = _finalists(study.entries, starts)
    winner, found_by, selection_s = _select(problem, finalists, request.seed, executor)
    best, *baselines = verify(problem, [winner, *problem.baselines.values()], request.seed, executor)
    simulated = sum(outcome.simulated_s for _, row in known for outcome in row) + selection_s
    simulated += sum(entry.simulated_s for entry in study.entries)
    simulated += sum(verified.simulated_s for verified in [best, *baselines])
    return Optimised(request, study.entries, found_by, best, baselines, simulated, time.monotonic() - began)


def _select(
    problem: Problem, finalists: list[tuple[Gait, str]], seed: int, executor: Executor
) -> tuple[Gait, str, float]:
    """Return the best of the finalists on fresh scenarios, who found it, and the simulated seconds.

    The search's own best is the luckiest on its few scenarios; a fresh draw is not so easily fooled.
    """
    scenarios = scenarios_of(problem, seed, SELECTION)
    evaluator = Evaluator(Setting.of(problem, scenarios, problem.simulation.working), executor)
    judged = evaluator([gait for gait, _ in finalists])
    costs = [evaluation.cost for evaluation, _ in judged]
    gait, found_by = finalists[costs.index(min(costs))]
    spent = sum(outcome.simulated_s for _, row in judged for outcome in row)
    return Gait(gait.period_s, gait.channels, "best"), found_by, spent


def _finalists(entries: list[Entry], starts: Sequence[tuple[Gait, float]]) -> list[tuple[Gait, str]]:
    """Return the search's leaders, and the best baseline in case none of them beats it."""
    ranked = sorted(entries, key=lambda entry: (entry.evaluation.cost, entry.index))
    leaders = [entry for entry in ranked if entry.evaluation.status == "ok"][:_FINALISTS]
    if not leaders:
        raise GaitoptError(
            f"every one of {len(entries)} gaits failed; the first: {entries[0].evaluation.status}"
        )
    best_baseline = [min(starts, key=lambda start: start[1])[0]] if starts else []
    named = [(entry.gait, entry.method) for entry in leaders]
    return named + [(gait, gait.name) for gait in best_baseline]
