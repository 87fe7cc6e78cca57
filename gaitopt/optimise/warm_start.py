"""The warm start: gaits that the planar model plans, and how well it predicts MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scipy import stats

from gaitopt.optimise.evaluator import Evaluator, simulated_s
from gaitopt.optimise.journal import Entry
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.verification import Verified
from gaitopt.plan.plan import Elite, Plan, Planner, PlanSettings
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup


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
class Planned:
    """What a search can start from.

    Attributes:
        planner: the planar model; None for a cold search.
        plan: the plan; None for a cold search.
        notes: why the search is cold, if a warm start was requested.
    """

    planner: Planner | None = None
    plan: Plan | None = None
    notes: tuple[str, ...] = ()

    @property
    def elites(self) -> Sequence[Elite]:
        """The planned gaits, fastest first."""
        return self.plan.elites if self.plan else ()


@dataclass(frozen=True)
class Correlation:
    """How well the planar model ranks gaits.

    Attributes:
        rank: Spearman's rank correlation of planar and MuJoCo speeds over random gaits; None where fewer than
            half of them could be simulated.
        simulated_s: simulated seconds that this took.
    """

    rank: float | None = None
    simulated_s: float = 0.0


def planned(problem: Problem, warm: bool, settings: PlanSettings) -> Planned:
    """Return the plan that a search starts from, or why the search is cold.

    Args:
        problem: the problem.
        warm: whether a warm start is requested.
        settings: how hard to plan.
    """
    if not warm:
        return Planned()
    if problem.file.planar is None:
        return Planned(notes=(f"{problem.name} has no [planar] section, so the search is cold",))
    planner = Planner(problem, settings)
    plan = planner.plan()
    notes = () if plan.elites else ("no start of the plan converged, so the search is cold",)
    return Planned(planner, plan, notes)


def best_elite(entries: Sequence[Entry], elites: Sequence[Elite]) -> Elite | None:
    """Return the planned gait that was fastest in MuJoCo; the first entries are those of the plan."""
    speeds = [e.evaluation.metrics[SPEED.name] for e in entries[: len(elites)] if e.method == "plan"]
    order = sorted(range(len(speeds)), key=lambda i: -speeds[i] if math.isfinite(speeds[i]) else math.inf)
    return elites[order[0]] if order else None


def correlation(evaluator: Evaluator, planner: Planner | None, seed: int, count: int) -> Correlation:
    """Return how well planar speeds rank random gaits, compared with MuJoCo's, on the nominal robot.

    Args:
        evaluator: the evaluator of the search, for its robot, fidelity and executor.
        planner: the planar model; None for a cold search, which has nothing to compare.
        seed: seed of the random gaits.
        count: how many random gaits.
    """
    if planner is None:
        return Correlation()
    nominal = replace(evaluator, setup=_nominal(evaluator.setup), margin=0.0)
    space = evaluator.setup.problem.space
    gaits = [space.decode(point) for point in quasi_random(space, count, seed)]
    judged = nominal(gaits)
    outcomes = [one.outcomes[0] for one in judged]
    pairs = [
        (planner.predicted_speed(gait), outcome.metrics[SPEED.name])
        for gait, outcome in zip(gaits, outcomes, strict=True)
        if outcome.status == "ok"
    ]
    spent = simulated_s(judged)
    if len(pairs) < count // 2:
        return Correlation(None, spent)
    return Correlation(float(stats.spearmanr(*zip(*pairs, strict=True)).statistic), spent)


def _nominal(setup: RobotSetup) -> RobotSetup:
    return RobotSetup.of(setup.problem, (NOMINAL,), setup.fidelity)
