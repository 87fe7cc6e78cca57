"""The main job: baselines, search, selection of the winner, verification."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from gaitopt.core.errors import bad_value
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise import settings as defaults
from gaitopt.optimise.evaluator import Evaluator, simulated_s
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.ladder import Rung
from gaitopt.optimise.margins import Margin, margins
from gaitopt.optimise.notes import (
    convergence_notes,
    drift_notes,
    failure_notes,
    posterior_notes,
    warnings_of,
)
from gaitopt.optimise.pareto import FrontGait, front_of, thinned, verified_front
from gaitopt.optimise.recorder import SEARCH
from gaitopt.optimise.selection import CONFIRMATION, SELECTION, finalists, select
from gaitopt.optimise.settings import SearchSettings
from gaitopt.optimise.stages import DEFAULT_METHOD, method_names, method_of
from gaitopt.optimise.study import Start, Study
from gaitopt.optimise.verification import (
    TIMESTEP,
    VERIFICATION,
    Convergence,
    Verified,
    convergence,
    scenarios_of,
    verify,
)
from gaitopt.optimise.warm_start import Planned, WarmStart, best_elite, correlation, planned
from gaitopt.plan.plan import Elite, Plan
from gaitopt.problem.problem import Problem
from gaitopt.simulation.audit.finding import Finding
from gaitopt.simulation.check import check_gait
from gaitopt.simulation.objective import check_searchable
from gaitopt.simulation.setup import RobotSetup

DEFAULT_BUDGET = 600

LARGEST_BUDGET = 10**7
"""A larger budget in a run folder is refused, gaits: a hundred gaits a second would take over a day."""


_HAND_TUNED, _PLAN, _CHECK, _FRONT = "hand-tuned gaits", "plan", "check of the best gait", "front"
_RANKS = "ranks of planned speeds"


def stages_of(request: Request) -> tuple[str, ...]:
    """Return the names of the stages of a search, in order; a cold search skips those of its plan."""
    front = (_FRONT,) if request.pareto else ()
    return (
        _HAND_TUNED,
        _PLAN,
        SEARCH,
        SELECTION,
        CONFIRMATION,
        VERIFICATION,
        TIMESTEP,
        _CHECK,
        *front,
        _RANKS,
    )


@dataclass(frozen=True)
class Request:
    """The request: with the problem, all that a result depends on.

    Attributes:
        seed: seed of all randomness.
        budget: gaits to evaluate.
        method: name of a method (see `stages.method_names`).
        warm_start: whether to start from planned gaits, where the problem says how.
        pareto: whether to search a front of speed against cost of transport, too.
    """

    seed: int = 1
    budget: int = DEFAULT_BUDGET
    method: str = DEFAULT_METHOD.name
    warm_start: bool = True
    pareto: bool = False

    def check(self, source: object) -> None:
        """Check the values of a request that was read from a file.

        Raises:
            GaitoptError: one is out of range.
        """
        if self.seed < 0:
            raise bad_value(source, "seed", self.seed, "0 or more")
        if not 1 <= self.budget <= LARGEST_BUDGET:
            raise bad_value(source, "budget", self.budget, f"1 to {LARGEST_BUDGET}")
        if self.method not in method_names():
            names = method_names()
            raise bad_value(source, "method", self.method, ", ".join(names), names)


@dataclass(frozen=True)
class Optimised:
    """What the main job found.

    Attributes:
        request: the request.
        entries: every evaluation of the search, in order.
        plan: the plan that the search started from; None for a cold search.
        warm_start: the best planned gait in MuJoCo; None for a cold search.
        rank_correlation: Spearman's of planar and MuJoCo speeds over random gaits; None for a cold search.
        notes: what the user should know, such as why the search was cold.
        found_by: the method, or the baseline, that the winner comes from.
        best: the winner, verified.
        baselines: the hand-tuned gaits, verified.
        simulated_s: simulated seconds of search and verification.
        wall_s: seconds it took.
        front: gaits of speed against cost of transport, if requested.
        rungs: cheaper rungs of the fidelity ladder that were measured; none if the budget is too small for
            that.
        convergence: the winner at the working fidelity, too.
        margins: what the winner leaves of each limit of the objective.
        findings: what the audit finds of the winner.
        warnings: what the owner of a robot must know of the winner before it is played.
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
    convergence: Convergence | None = None
    margins: Sequence[Margin] = ()
    findings: Sequence[Finding] = ()
    warnings: tuple[str, ...] = ()


def optimise(
    problem: Problem,
    request: Request,
    journal: Journal,
    executor: Executor,
    on_progress: OnProgress = silent,
    settings: SearchSettings | None = None,
) -> Optimised:
    """Search for the best gait of a problem, and verify it and the baselines.

    Args:
        problem: the problem.
        request: the request.
        journal: where every evaluation is written; a search continues after the evaluations that it holds.
        executor: where the rollouts run.
        on_progress: called as each batch or rollout ends.
        settings: how to search; `settings.DEFAULT` by default.

    Raises:
        GaitoptError: the request or the objective is wrong, or every gait failed.
    """
    began = time.monotonic()
    check_searchable(problem)
    method, settings = method_of(request.method), settings or defaults.DEFAULT
    evaluator = _evaluator(problem, request.seed, executor, settings)
    study = Study(evaluator, journal, request.budget, request.seed, on_progress, settings.study)
    baselines = list(problem.baselines.values())
    on_progress(Progress(_HAND_TUNED))
    known = evaluator(baselines)
    starts = [Start(gait, one.evaluation) for gait, one in zip(baselines, known, strict=True)]
    on_progress(Progress(_PLAN))
    warm = planned(problem, request.warm_start, replace(settings.plan, seed=request.seed))
    study.run(method, starts, [elite.gait for elite in warm.elites], request.pareto, laddered=True)
    among = finalists(study.entries, starts, settings.finalists, problem.space)
    winner = select(problem, among, executor, request.seed, on_progress)
    final = _verification(
        problem, winner.gait, best_elite(study.entries, warm.elites), request.seed, executor, on_progress
    )
    coarse = convergence(problem, final.best, request.seed, executor, on_progress=on_progress)
    on_progress(Progress(_CHECK))
    left = margins(problem, final.best)
    findings = check_gait(problem, final.best.gait, executor)
    front = _front(problem, study, request, executor, settings, on_progress) if request.pareto else []
    on_progress(Progress(_RANKS))
    ranks = correlation(evaluator, warm.planner, request.seed, settings.correlation_gaits)
    return Optimised(
        request=request,
        entries=study.entries,
        plan=warm.plan,
        warm_start=final.warm_start,
        rank_correlation=ranks.rank,
        notes=_notes(warm, study, final.baselines, settings) + convergence_notes(coarse, final.best, problem),
        found_by=winner.found_by,
        best=final.best,
        baselines=final.baselines,
        simulated_s=simulated_s(known)
        + winner.simulated_s
        + ranks.simulated_s
        + sum(entry.simulated_s for entry in study.entries)
        + sum(verified.simulated_s for verified in final.all)
        + coarse.working.simulated_s
        + sum(gait.verified.simulated_s for gait in front)
        + sum(rung.simulated_s for rung in study.rungs),
        wall_s=time.monotonic() - began,
        front=front,
        rungs=study.rungs,
        convergence=coarse,
        findings=findings,
        margins=left,
        warnings=warnings_of(problem, final.best, left, findings),
    )


def _evaluator(problem: Problem, seed: int, executor: Executor, settings: SearchSettings) -> Evaluator:
    """Return the evaluator of the search."""
    scenarios = scenarios_of(problem, seed, Stream.SEARCH_SCENARIOS)
    setup = RobotSetup.of(problem, scenarios, problem.simulation.working)
    return Evaluator(setup, executor, problem.objective.search_margin, settings.raced_on)


@dataclass(frozen=True)
class _Verification:
    """The winner, the baselines and the best planned gait, verified."""

    best: Verified
    baselines: list[Verified]
    warm_start: WarmStart | None

    @property
    def all(self) -> list[Verified]:
        """Every gait that was verified."""
        return [self.best, *self.baselines, *([self.warm_start.verified] if self.warm_start else [])]


def _verification(
    problem: Problem,
    winner: Gait,
    elite: Elite | None,
    seed: int,
    executor: Executor,
    on_progress: OnProgress,
) -> _Verification:
    gaits = [winner, *problem.baselines.values(), *([elite.gait] if elite else [])]
    best, *others = verify(problem, gaits, seed, executor, on_progress=on_progress)
    warm = WarmStart(others.pop(), elite.predicted_speed_m_s) if elite else None
    return _Verification(best, others, warm)


def _notes(
    warm: Planned, study: Study, baselines: Sequence[Verified], settings: SearchSettings
) -> tuple[str, ...]:
    """Return what the user should know."""
    drifts = drift_notes(warm.plan.baselines, baselines, settings.drift_ratio) if warm.plan else ()
    robots = posterior_notes(study.evaluator.setup.problem)
    return robots + warm.notes + drifts + failure_notes(study.entries, baselines)


def _front(
    problem: Problem,
    study: Study,
    request: Request,
    executor: Executor,
    settings: SearchSettings,
    on_progress: OnProgress,
) -> list[FrontGait]:
    """Return gaits of the front of a search, verified."""
    chosen = thinned(front_of(study.entries), settings.study.front.shown)
    named = [Gait(e.gait.period_s, e.gait.channels, f"front-{i}") for i, e in enumerate(chosen, 1)]
    verified = verify(problem, named, request.seed, executor, None, on_progress, _FRONT)
    return verified_front(chosen, verified)
