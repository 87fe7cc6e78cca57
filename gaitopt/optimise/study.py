"""The study: walks through the stages of a method with one budget."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import OnProgress, silent
from gaitopt.core.streams import Stream, generator
from gaitopt.gait.gait import Gait
from gaitopt.gait.ties import TiedSpace
from gaitopt.optimise import pareto
from gaitopt.optimise.evaluator import Cost, Evaluator, cost_of
from gaitopt.optimise.journal import WORKING, Entry, Journal, at_rung, succeeded
from gaitopt.optimise.ladder import LadderSettings, Rung, descend, measured
from gaitopt.optimise.penalty import Penalty, PenaltySettings
from gaitopt.optimise.quasi_random import near_plan, quasi_random
from gaitopt.optimise.recorder import Judge, Recorder
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.solution import Box, Evaluate
from gaitopt.optimise.solvers.solver import Choose, Minimisation, Solver, draws
from gaitopt.optimise.solvers.surrogate import SurrogateSettings, most_promising
from gaitopt.optimise.stages import DEFAULT_METHOD, FirstBatch, Method, Stage, with_ties
from gaitopt.simulation.objective import Evaluation

LOWER = "lower"
"""The rung of gaits judged below the working fidelity; `Study.rungs` says how far below."""


@dataclass(frozen=True)
class StudySettings:
    """How a study searches.

    Attributes:
        spread: length of the first steps of a cold search, in units of the box.
        planned_spread: the same for a search from a plan.
        ladder: when a cheaper rung may judge gaits.
        front: how the front of speed against cost of transport is searched.
        surrogate: how candidates are chosen.
        penalty: how the penalties of broken limits adapt while populations are ranked.
    """

    spread: float = 0.1
    planned_spread: float = 0.05
    ladder: LadderSettings = field(default_factory=LadderSettings)
    front: pareto.FrontSettings = field(default_factory=pareto.FrontSettings)
    surrogate: SurrogateSettings = field(default_factory=SurrogateSettings)
    penalty: PenaltySettings = field(default_factory=PenaltySettings)


@dataclass(frozen=True)
class Start:
    """A gait that was judged before the search, such as a baseline."""

    gait: Gait
    evaluation: Evaluation


@dataclass(frozen=True)
class _Known:
    """A point that was judged before the first stage."""

    point: NDArray[np.float64]
    evaluation: Evaluation


class Study:
    """One search: proposes gaits, stage by stage, until its budget is spent.

    Attributes:
        evaluator: judges gaits at the working fidelity.
        budget: gaits to evaluate.
        seed: seed of all randomness.
        rungs: the cheaper rungs that were measured, and whether the search used them.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        journal: Journal,
        budget: int,
        seed: int,
        on_progress: OnProgress = silent,
        settings: StudySettings = StudySettings(),
    ):
        if budget < 1:
            raise GaitoptError(f"--budget: found {budget}; allowed: 1 or more")
        self.evaluator = evaluator
        self.budget = self._until = budget
        self.seed = seed
        self.rungs: list[Rung] = []
        self._settings = settings
        self._lowest = evaluator
        objective = evaluator.setup.problem.objective
        self._penalty = Penalty(objective.penalty, objective.constraints, settings.penalty)
        self._space = evaluator.setup.problem.space
        self._tied_spaces = evaluator.setup.problem.tied_spaces
        self._ties: TiedSpace | None = None
        self._recorder = Recorder(journal, self._space, budget, on_progress)
        self._evaluate = self._recorder.evaluate

    @property
    def entries(self) -> list[Entry]:
        """The evaluations so far, in order."""
        return self._recorder.entries

    @property
    def best(self) -> Entry:
        """The best gait so far (see `Recorder.best`)."""
        return self._recorder.best

    def run(
        self,
        method: Method = DEFAULT_METHOD,
        starts: Sequence[Start] = (),
        planned: Sequence[Gait] = (),
        front: bool = False,
        laddered: bool = False,
    ) -> Entry:
        """Spend the budget and return the best gait.

        Args:
            method: the stages of the search.
            starts: gaits that were judged before, such as the baselines.
            planned: gaits of a plan, evaluated first; the first batch of the method is near them.
            front: spend `FrontSettings.share` of the budget on speed against cost of transport, after the
                rest.
            laddered: stages may descend to cheaper rungs of the fidelity ladder, where they allow it. They do
                not with a front, which is made of all gaits.
        """
        settings = self._settings
        self._until = self.budget - (round(settings.front.share * self.budget) if front else 0)
        if self._tied_spaces:
            gait = self.evaluator.setup.problem.file.gait
            method = with_ties(method, gait.freed_share if gait else None)
        start = self._start(method, starts, planned)
        spread = settings.planned_spread if planned else settings.spread
        for index, stage in enumerate(method.stages):
            later = sum(round(after.share * self._until) for after in method.stages[index + 1 :])
            x0 = self.best.point if stage.from_search and self.entries else start
            self._solve(stage, x0, stage.spread or spread, self._left - later, laddered and not front)
        self._until = self.budget
        if front:
            self._search_front()
        self._recorder.check_journal()
        return self.best

    @property
    def _left(self) -> int:
        return self._until - len(self.entries)

    @property
    def _rung(self) -> str:
        return WORKING if self._lowest is self.evaluator else LOWER

    def _start(self, method: Method, starts: Sequence[Start], planned: Sequence[Gait]) -> NDArray[np.float64]:
        """Evaluate the gaits of the plan or the first batch, and return the best point known then.

        CMA-ES begins with small penalties: for it a fast gait that breaks a limit is a good start, too.
        """
        if self._tied_spaces:
            return self._tied_start(method, starts, planned)
        known = [_Known(self._space.encode(start.gait), start.evaluation) for start in starts]
        if planned:
            points = np.array([self._space.encode(gait) for gait in planned])[: self._left]
            known += self._known("plan", points)
            known += self._near_plan(method.first, planned)
        elif method.first is not None:
            count = method.first.count(self._until)
            known += self._known("quasi-random", quasi_random(self._space, count, self.seed))
        if not known:
            return np.full(len(self._space.variables), 0.5)
        aim = self._aim(method.stages[0].solver)
        return min(known, key=lambda one: aim(one.evaluation)).point

    def _near_plan(self, first: FirstBatch | None, planned: Sequence[Gait]) -> list[_Known]:
        if first is None or not self._left:
            return []
        count = min(first.count(self._until, planned=True), self._left)
        spread = self._settings.planned_spread
        points = near_plan(self._space, planned, count, self.seed, spread, first.slower)
        return self._known("near-plan", points)

    def _tied_start(
        self, method: Method, starts: Sequence[Start], planned: Sequence[Gait]
    ) -> NDArray[np.float64]:
        """Evaluate known gaits and a first batch within the ties of each template; go on with the best ties.

        Returns:
            The best point known within them.
        """
        aim, given = self._aim(method.stages[0].solver), [*planned, *(start.gait for start in starts)]
        batch = (method.first or FirstBatch()).count(self._until) // len(self._tied_spaces)
        bests: list[tuple[float, int, NDArray[np.float64]]] = []
        for index, ties in enumerate(self._tied_spaces):
            left = self._left // (len(self._tied_spaces) - index)
            drawn = quasi_random(ties, max(1, batch), self.seed, Stream.TIED_FIRST_BATCH, index)
            points = ties.lift(np.array([*map(ties.encode, given), *drawn])[:left])
            if len(points):
                cost, best = min(
                    ((aim(one.evaluation), one.point) for one in self._known(ties.name, points)),
                    key=lambda one: one[0],
                )
                bests.append((cost, index, best))
        _, chosen, point = min(bests, key=lambda one: one[:2])
        self._ties = self._tied_spaces[chosen]
        return point

    def _known(self, method: str, points: NDArray[np.float64]) -> list[_Known]:
        entries = self._judged(method, points, self.evaluator)
        return [_Known(entry.point, entry.evaluation) for entry in entries]

    def _judged(
        self, method: str, points: NDArray[np.float64], judge: Judge, rung: str = WORKING
    ) -> list[Entry]:
        """Evaluate candidates, and return their entries."""
        before = len(self.entries)
        self._evaluate(method, points, judge, rung)
        return self.entries[before:]

    def _aim(self, solver: Solver) -> Cost:
        """Return what a solver minimises; only one that ranks populations can follow penalties that adapt."""
        return self._penalty.cost if solver.ranks_populations else cost_of

    # --- stages -----------------------------------------------------------------------------------

    def _solve(
        self, stage: Stage, x0: NDArray[np.float64], spread: float, budget: int, laddered: bool
    ) -> None:
        """Let the solver of a stage spend its budget."""
        if budget < 1:
            return
        solver = stage.solver
        descends = laddered and stage.may_descend and budget >= self._settings.ladder.from_gaits
        costs = self._descending(stage) if descends else self._costs(stage)
        ties = self._ties if stage.tied else None
        aim = self._aim(solver)
        choose = self._chooser(lambda entry: aim(entry.evaluation), ties)
        rng = generator(self.seed, Stream.FREED_SEARCH) if stage.freed else draws(solver, self.seed)
        box = Box((ties or self._space).circular)
        if ties is not None:
            x0, costs = ties.project([x0])[0], _within(ties, costs)
        solver.minimise(Minimisation(costs, box, x0, spread, budget, rng, choose))
        if stage.may_descend:
            self._climb(solver.name)

    def _costs(self, stage: Stage) -> Evaluate:
        """Return the function that gives a solver the costs of its candidates."""
        solver = stage.solver

        def costs(points: NDArray[np.float64]) -> NDArray[np.float64]:
            if solver.ranks_populations:
                race = partial(self._lowest.race, aim=self._penalty.cost)
                population = self._judged(solver.name, points, race, self._rung)
                return self._penalty.costs([entry.evaluation for entry in population])
            return self._evaluate(solver.name, points, self.evaluator)

        return costs

    def _descending(self, stage: Stage) -> Evaluate:
        """Return the same for a stage that uses a lower rung after its first population.

        The first population is judged at the working fidelity, and cheaper rungs are measured by it. The same
        holds for later ones while a lower rung is used, as `LadderSettings.every` says. The solver compares
        costs within one population only, so costs of two rungs are never compared.
        """
        costs, ladder, aim = self._costs(stage), self._settings.ladder, self._penalty.cost
        populations = itertools.count()

        def descending(points: NDArray[np.float64]) -> NDArray[np.float64]:
            first = not self.rungs
            lowered = self._lowest is not self.evaluator
            if not first and not (lowered and next(populations) % ladder.every == ladder.every - 1):
                return costs(points)
            population = self._judged(stage.solver.name, points, self.evaluator)
            gaits = [entry.gait for entry in population]
            judged = [entry.evaluation for entry in population]
            exact = np.array([aim(one) for one in judged])
            if first:
                descent = descend(self.evaluator, gaits, exact, ladder, aim)
                self._lowest, self.rungs = descent.evaluator, descent.rungs
            else:
                name = ", ".join(rung.name for rung in self.rungs if rung.used and not rung.after)
                after = population[0].index
                self.rungs.append(measured(name, self._lowest, gaits, exact, ladder, aim, after))
                if not self.rungs[-1].used:
                    self._lowest = self.evaluator
            return self._penalty.costs(judged)

        return descending

    def _climb(self, method: str) -> None:
        """Judge the best gaits of a lower rung at the working fidelity."""
        lower = succeeded(self.entries, LOWER)
        points = [entry.point for entry in lower[: min(self._settings.ladder.climbers, self._left)]]
        if points:
            self._evaluate(method, np.array(points), self.evaluator)

    # --- the front --------------------------------------------------------------------------------

    def _search_front(self) -> None:
        """Search for the cheapest gait, then for the fastest one under each of some limits of its cost.

        Without a front there is no limit yet, and the search for the cheapest gait continues.
        """
        levels = self._settings.front.levels
        runs = 1 + levels
        for index in range(runs):
            limits = pareto.limits(self.entries, levels)
            aim = pareto.fastest_within(limits[index - 1]) if index and limits else pareto.cheapest
            self._pursue(aim, self._left // (runs - index), index)

    def _pursue(self, aim: pareto.Aim, budget: int, stream: int) -> None:
        """Minimise another aim than the cost, from the best gait so far by that aim; within ties, if any."""
        if budget < 1:
            return

        def costs(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.array([aim(entry) for entry in self._judged("pareto", points, self.evaluator)])

        start, ties = min(self.entries, key=aim).point, self._ties
        rng, box = generator(self.seed, Stream.FRONT + stream), Box((ties or self._space).circular)
        spread, choose = self._settings.front.spread, self._chooser(aim, ties)
        if ties is not None:
            start = ties.project([start])[0]
        within = costs if ties is None else _within(ties, costs)
        CmaEs().minimise(Minimisation(within, box, start, spread, budget, rng, choose))

    def _chooser(self, aim: pareto.Aim, ties: TiedSpace | None = None) -> Choose:
        """Return the chooser of candidates, from all evaluations so far on the rung that judges them.

        Args:
            aim: what the candidates are judged by.
            ties: the ties that candidates obey, if any; other evaluations then count by their free channels.
        """
        space = ties or self._space

        def choose(candidates: NDArray[np.float64], count: int) -> NDArray[np.float64]:
            known = at_rung(self.entries, self._rung)
            points = np.array([entry.point for entry in known]).reshape(-1, len(self._space.variables))
            if ties is not None:
                points = ties.project(points).reshape(-1, candidates.shape[1])
            costs = np.array([aim(entry) for entry in known])
            circular, settings = space.circular, self._settings.surrogate
            return most_promising(points, costs, candidates, count, circular, settings)

        return choose


def _within(ties: TiedSpace, costs: Evaluate) -> Evaluate:
    """Return the costs of points of the space of some ties."""

    def within(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return costs(ties.lift(points))

    return within
