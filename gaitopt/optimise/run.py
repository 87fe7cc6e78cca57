"""The main job: baselines, search, selection of the winner, verification."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from scipy import stats

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import DROPPED, Evaluator
from gaitopt.optimise.journal import Entry, Journal, at_rung, ranked
from gaitopt.optimise.ladder import Rung
from gaitopt.optimise.pareto import FrontGait, front_of, thinned, verified_front
from gaitopt.optimise.study import Progress, Study, quasi_random
from gaitopt.optimise.verification import Verified, scenarios_of, verify
from gaitopt.plan.plan import Elite, Plan, Planner, PlanSettings
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.objective import check_searchable
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

DEFAULT_BUDGET = 600

_FINALISTS = 5
_DRIFTS = 0.5
"""Sideways over forward speed above which a gait is no business of a planar model."""

_SAMPLE = 24
"""Random gaits over which the planar model is held against MuJoCo."""


@dataclass(frozen=True)
class Request:
    """What was asked for: with the problem, all that a result depends on."""

    seed: int = 1
    budget: int = DEFAULT_BUDGET
    method: str = "default"
    warm_start: bool = True
    pareto: bool = False


@dataclass(frozen=True)
class WarmStart:
    """The best planned gait in MuJoCo.

    Attributes:
        verified: the gait, verified.
        predicted_speed_m_s: the speed that the plan predicts for it, m/s.
    """

    verified: Verified
    predicted_speed_m_s: float


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
class Optimised:
    """What the main job found.

    Attributes:
        request: what was asked for.
        entries: every evaluation of the search, in order.
        plan: the plan that the search started from; None for a cold search.
        warm_start: the best planned gait in MuJoCo; None for a cold search.
        rank_correlation: Spearman's of planar and MuJoCo speeds over random gaits; None for a cold search.
        notes: what the user should know, such as why the search was cold.
        found_by: the method, or the baseline, that the winner comes from.
        best: the winner, verified.
        baselines: the hand-tuned gaits, verified.
        simulated_s: simulated seconds in all.
        wall_s: seconds it took.
        front: gaits of speed against cost of transport, where they were asked for.
        rungs: cheaper rungs of the fidelity ladder that were measured; none where that would not pay.
    """

    request: Request
    entries: list[Entry]
    plan: Plan | None
    warm_start: WarmStart | None
    rank_correlation: float | None
    notes: tuple[str, ...]
    found_by: str
    best: Verified
    baselines: list[Verified]
    simulated_s: float
    wall_s: float
    front: Sequence[FrontGait] = ()
    rungs: Sequence[Rung] = ()


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
    check_searchable(problem)
    setting = RobotSetup.of(
        problem, scenarios_of(problem, request.seed, Stream.SEARCH_SCENARIOS), problem.simulation.working
    )
    margin = problem.objective.search_margin
    evaluator = Evaluator(setting, executor, margin)
    study = Study(evaluator, journal, request.budget, request.seed, on_progress)
    baselines = list(problem.baselines.values())
    known = evaluator(baselines)
    starts = [(gait, one.evaluation.cost) for gait, one in zip(baselines, known, strict=True)]
    planner, notes = _planner(problem, request)
    plan = planner.plan() if planner else None
    if plan is not None and not plan.elites:
        notes += ("no start of the plan converged, so the search is cold",)
    elites = plan.elites if plan else ()
    study.run(request.method, starts, [elite.gait for elite in elites], request.pareto, laddered=True)
    winner = _select(problem, _finalists(study.entries, starts), request.seed, executor)
    planned = _best_elite(study.entries, elites)
    gaits = [winner.gait, *baselines, *([planned.gait] if planned else [])]
    best, *others = verify(problem, gaits, request.seed, executor)
    notes += _drift_notes(plan, others[: len(baselines)]) if plan else ()
    notes += _failure_notes(study.entries, [gait.name for gait in baselines], others)
    chosen = thinned(front_of(study.entries)) if request.pareto else []
    named = [Gait(e.gait.period_s, e.gait.channels, f"front-{i}") for i, e in enumerate(chosen, 1)]
    front = verified_front(chosen, verify(problem, named, request.seed, executor))
    correlation, sample_s = _correlation(evaluator, planner, request.seed) if planner else (None, 0.0)
    simulated = sum(outcome.simulated_s for one in known for outcome in one.outcomes)
    simulated += winner.simulated_s
    simulated += sample_s
    simulated += sum(entry.simulated_s for entry in study.entries)
    simulated += sum(verified.simulated_s for verified in [best, *others])
    simulated += sum(gait.verified.simulated_s for gait in front)
    simulated += sum(rung.simulated_s for rung in study.rungs)
    return Optimised(
        request=request,
        entries=study.entries,
        plan=plan,
        warm_start=WarmStart(others[-1], planned.predicted_speed_m_s) if planned else None,
        rank_correlation=correlation,
        notes=notes,
        found_by=winner.found_by,
        best=best,
        baselines=others[: len(baselines)],
        simulated_s=simulated,
        wall_s=time.monotonic() - began,
        front=front,
        rungs=study.rungs,
    )


def _planner(problem: Problem, request: Request) -> tuple[Planner | None, tuple[str, ...]]:
    """Return the planner of a warm start, or None and why the search is cold."""
    if not request.warm_start:
        return None, ()
    if problem.file.planar is None:
        return None, (f"{problem.name} has no [planar] section, so the search is cold",)
    return Planner(problem, PlanSettings(seed=request.seed)), ()


def _drift_notes(plan: Plan, baselines: Sequence[Verified]) -> tuple[str, ...]:
    """Return what a planar model misses of the baselines that drift sideways."""
    return tuple(
        f"{row.gait.name} drifts sideways at {row.evaluation.metrics['sideways_ratio']:.0%} of its speed, "
        f"which the planar model does not know: it predicts {1e3 * plan.baselines[row.gait.name]:.1f} mm/s "
        f"where MuJoCo has {1e3 * row.speed:.1f}"
        for row in baselines
        if row.evaluation.metrics["sideways_ratio"] > _DRIFTS
    )


def _failure_notes(
    entries: Sequence[Entry], baselines: Sequence[str], verified: Sequence[Verified]
) -> tuple[str, ...]:
    """Return how many gaits of the search failed in simulation and why, and which baselines did."""
    statuses = [entry.evaluation.status for entry in entries]
    reasons = Counter(one for one in statuses if one != "ok" and not one.startswith(DROPPED))
    said = _counted(reasons)
    searched = (f"{reasons.total()} of {len(entries)} gaits failed in simulation: {said}",) if said else ()
    return searched + tuple(
        f"{name} failed in simulation: {row.evaluation.status}"
        for name, row in zip(baselines, verified, strict=False)
        if row.evaluation.status != "ok"
    )


def _counted(reasons: Counter[str], most: int | None = None) -> str:
    return ", ".join(f"{reason} ({count})" for reason, count in reasons.most_common(most))


def _best_elite(entries: Sequence[Entry], elites: Sequence[Elite]) -> Elite | None:
    """Return the planned gait that was fastest in MuJoCo; the first entries are the plan's."""
    speeds = [e.evaluation.metrics[SPEED.name] for e in entries[: len(elites)] if e.method == "plan"]
    order = sorted(range(len(speeds)), key=lambda i: -speeds[i] if math.isfinite(speeds[i]) else math.inf)
    return elites[order[0]] if order else None


def _correlation(evaluator: Evaluator, planner: Planner, seed: int) -> tuple[float | None, float]:
    """Return how well planar and MuJoCo speeds rank alike over random gaits, and the seconds simulated."""
    setting = evaluator.setup
    nominal = Evaluator(RobotSetup.of(setting.problem, (NOMINAL,), setting.fidelity), evaluator.executor)
    points = quasi_random(setting.problem.space, _SAMPLE, seed)
    gaits = [setting.problem.space.decode(point) for point in points]
    outcomes = [row[0] for row in nominal.outcomes(gaits)]
    pairs = [
        (planner.predicted_speed(gait), outcome.metrics[SPEED.name])
        for gait, outcome in zip(gaits, outcomes, strict=True)
        if outcome.status == "ok"
    ]
    simulated_s = sum(outcome.simulated_s for outcome in outcomes)
    if len(pairs) < _SAMPLE // 2:  # too few gaits could be simulated to tell
        return None, simulated_s
    return float(stats.spearmanr(*zip(*pairs, strict=True)).statistic), simulated_s


def _select(problem: Problem, finalists: list[tuple[Gait, str]], seed: int, executor: Executor) -> Selected:
    """Return the best of the finalists on fresh scenarios.

    The best gait of the search is partly the luckiest on its few scenarios; fresh scenarios correct that.
    """
    scenarios = scenarios_of(problem, seed, Stream.SELECTION_SCENARIOS)
    setting = RobotSetup.of(problem, scenarios, problem.simulation.working)
    evaluator = Evaluator(setting, executor, problem.objective.search_margin)
    judged = evaluator([gait for gait, _ in finalists])
    costs = [one.evaluation.cost for one in judged]
    gait, found_by = finalists[costs.index(min(costs))]
    spent = sum(outcome.simulated_s for one in judged for outcome in one.outcomes)
    return Selected(Gait(gait.period_s, gait.channels, "best"), found_by, spent)


def _finalists(entries: list[Entry], starts: Sequence[tuple[Gait, float]]) -> list[tuple[Gait, str]]:
    """Return the search's leaders, and the best baseline in case none of them beats it."""
    leaders = [entry for entry in ranked(at_rung(entries)) if entry.evaluation.status == "ok"][:_FINALISTS]
    if not leaders:
        reasons = Counter(entry.evaluation.status for entry in entries)
        said = _counted(reasons, 5)
        raise GaitoptError(f"every one of {len(entries)} gaits failed in simulation: {said}")
    best_baseline = [min(starts, key=lambda start: start[1])[0]] if starts else []
    named = [(entry.gait, entry.method) for entry in leaders]
    return named + [(gait, gait.name) for gait in best_baseline]
