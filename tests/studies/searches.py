"""A search like that of `gaitopt optimise`, without its folder; studies observe or change parts of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Cost, Evaluated, Evaluator, cost_of
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.selection import Selected, finalists, select
from gaitopt.optimise.settings import SearchSettings
from gaitopt.optimise.stages import DEFAULT_METHOD, Method
from gaitopt.optimise.study import Start, Study, StudySettings
from gaitopt.optimise.verification import Verified, scenarios_of, verify
from gaitopt.plan.plan import Planner, PlanSettings
from gaitopt.problem.problem import Problem
from gaitopt.simulation.setup import RobotSetup

Starts = list[Start]


def planned(problem: Problem, seed: int) -> tuple[Gait, ...]:
    """Return the gaits of a plan."""
    return tuple(elite.gait for elite in Planner(problem, PlanSettings(seed=seed)).plan().elites)


def setting_of(problem: Problem, seed: int) -> RobotSetup:
    """Return the settings at which a search with a seed judges gaits."""
    return RobotSetup.of(
        problem, scenarios_of(problem, seed, Stream.SEARCH_SCENARIOS), problem.simulation.working
    )


def judged(evaluator: Any) -> Starts:
    """Return the baselines with their costs, which a search begins with."""
    baselines = list(evaluator.setup.problem.baselines.values())
    return [Start(gait, one.evaluation) for gait, one in zip(baselines, evaluator(baselines), strict=True)]


def evaluator_of(problem: Problem, seed: int) -> Evaluator:
    """Return the evaluator of a search with a seed."""
    return Evaluator(setting_of(problem, seed), SerialExecutor(), problem.objective.search_margin)


class Recording:
    """An evaluator with one scenario that keeps the costs of gaits.

    Attributes:
        costs: the cost of each gait, in order.
        simulated_s: the simulated seconds of each.
    """

    def __init__(self, evaluator: Any):
        self.setup = evaluator.setup
        self.costs: list[float] = []
        self.simulated_s: list[float] = []
        self._evaluator = evaluator

    def __call__(self, gaits: Sequence[Gait]) -> list[Evaluated]:
        """Return evaluation and outcomes of each gait."""
        rows: list[Evaluated] = self._evaluator(gaits)
        self.costs += [one.evaluation.cost for one in rows]
        self.simulated_s += [one.simulated_s for one in rows]
        return rows

    def race(self, gaits: Sequence[Gait], aim: Cost = cost_of) -> list[Evaluated]:
        """Return the same: over one scenario no gait can be dropped early."""
        return self(gaits)


def winner_of(study: Study, starts: Starts) -> tuple[Selected, Verified]:
    """Return the winner of a search, selected and verified as `gaitopt optimise` does."""
    problem, executor = study.evaluator.setup.problem, SerialExecutor()
    among = finalists(study.entries, starts, SearchSettings.finalists, problem.space)
    winner = select(problem, among, executor, study.seed)
    (verified,) = verify(problem, [winner.gait], study.seed, executor)
    return winner, verified


def search(
    evaluator: Any,
    budget: int,
    seed: int,
    starts: Starts,
    elites: Sequence[Gait] = (),
    laddered: bool = False,
    settings: StudySettings | None = None,
    method: Method = DEFAULT_METHOD,
) -> Study:
    """Return a search once it has spent its budget.

    Args:
        evaluator: an `Evaluator`, or an object that replaces it.
        budget: gaits, beside the baselines.
        seed: of the search.
        starts: the baselines with their costs.
        elites: gaits of a plan; without them the search has no warm start.
        laddered: whether it may use cheaper rungs.
        settings: how the study searches.
        method: the stages of the search.
    """
    with TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "evaluations.csv", evaluator.setup.problem)
        study = Study(evaluator, journal, budget, seed, settings=settings or StudySettings())
        study.run(method, starts, elites, laddered=laddered)
    return study
