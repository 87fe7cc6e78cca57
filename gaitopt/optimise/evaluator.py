"""The evaluation of gaits over scenarios on an executor, in an order that no scheduling can change."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, Executor
from dataclasses import dataclass, replace

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import Metrics, measure
from gaitopt.simulation.objective import Evaluation, evaluate
from gaitopt.simulation.setup import RobotSetup, prepared

RACED_ON = 2.0 / 3.0
"""Share of a population that is simulated in every scenario.

With this share, none of the three best of twelve neighbours is lost; with a half, one in eleven is. See
``results/profile``."""

DROPPED = "dropped"
"""The status of a gait that the race has dropped begins so."""


@dataclass(frozen=True)
class Outcome:
    """One gait in one scenario.

    Attributes:
        metrics: its metrics.
        status: ``ok``, or why the simulation failed.
        simulated_s: simulated seconds.
    """

    metrics: Metrics
    status: str
    simulated_s: float


@dataclass(frozen=True)
class Evaluated:
    """One gait over some scenarios.

    Attributes:
        evaluation: its cost, metrics and violations.
        outcomes: the outcome in each scenario.
    """

    evaluation: Evaluation
    outcomes: list[Outcome]

    @property
    def simulated_s(self) -> float:
        """Simulated seconds in all."""
        return sum(outcome.simulated_s for outcome in self.outcomes)


def assess(setup: RobotSetup, drive: Drive, scenario: int) -> Outcome:
    """Simulate and measure one gait or log in one scenario: the unit of work of every executor."""
    ready = prepared(setup, scenario)
    trajectory = ready.simulator.run(drive, ready.scenario)
    metrics = measure(setup.problem, drive, trajectory, ready.robot)
    return Outcome(metrics, trajectory.status, ready.simulator.duration(drive))


def _nothing() -> None:
    """Tell nobody."""


def assess_all(
    work: Iterable[tuple[RobotSetup, Drive, int]],
    executor: Executor,
    on_done: Callable[[], object] = _nothing,
) -> list[Outcome]:
    """Return the outcome of each setup, gait and scenario, in the given order.

    Args:
        work: the setups, gaits and scenarios.
        executor: where they are simulated.
        on_done: called after each.

    Raises:
        GaitoptError: the connection to the executor's workers was lost.
    """
    try:
        futures = [executor.submit(assess, setup, drive, scenario) for setup, drive, scenario in work]
        outcomes = []
        for future in futures:
            outcomes.append(future.result())
            on_done()
        return outcomes
    except CancelledError:
        raise GaitoptError("--executor: the connection to its workers was lost") from None


def judge(problem: Problem, outcomes: Sequence[Outcome], margin: float = 0.0) -> Evaluation:
    """Return the evaluation of one gait from its outcomes, every limit tightened by `margin`."""
    return evaluate(problem, [o.metrics for o in outcomes], [o.status for o in outcomes], margin)


Judge = Callable[[Problem, Sequence[Outcome], float], Evaluation]
"""From the outcomes of one gait to its evaluation, every limit tightened by a share."""

Cost = Callable[[Evaluation], float]
"""What a search minimises of an evaluation: `cost_of`, or the same with smaller penalties."""


def cost_of(evaluation: Evaluation) -> float:
    """Return the cost of a gait with its full penalties."""
    return evaluation.cost


@dataclass(frozen=True)
class Evaluator:
    """Judges gaits with one setup, on an executor.

    Attributes:
        setup: robot, scenarios and fidelity.
        executor: where the rollouts run.
        margin: share by which every limit is tightened (see `Objective.search_margin`).
        raced_on: share of a population that `race` simulates in every scenario.
        on_done: called after each gait in each scenario.
        judge: what makes an evaluation of outcomes; by default the problem's objective.
    """

    setup: RobotSetup
    executor: Executor
    margin: float = 0.0
    raced_on: float = RACED_ON
    on_done: Callable[[], object] = _nothing
    judge: Judge = judge

    def outcomes(self, gaits: Sequence[Gait], scenarios: Sequence[int] | None = None) -> list[list[Outcome]]:
        """Return the outcome of each gait in each scenario, in the given order.

        Args:
            gaits: the gaits.
            scenarios: numbers of the scenarios; all by default.

        Raises:
            GaitoptError: the connection to the executor's workers was lost.
        """
        scenarios = range(len(self.setup.scenarios)) if scenarios is None else scenarios
        work = [(self.setup, gait, scenario) for gait in gaits for scenario in scenarios]
        done = iter(assess_all(work, self.executor, self.on_done))
        return [[next(done) for _ in scenarios] for _ in gaits]

    def __call__(self, gaits: Sequence[Gait]) -> list[Evaluated]:
        """Return evaluation and outcomes of each gait, in the given order."""
        return [Evaluated(self._judged(row), row) for row in self.outcomes(gaits)]

    def _judged(self, row: Sequence[Outcome]) -> Evaluation:
        return self.judge(self.setup.problem, row, self.margin)

    def race(self, gaits: Sequence[Gait], aim: Cost = cost_of) -> list[Evaluated]:
        """Return evaluation and outcomes of each gait; the worst in the first scenario are dropped after it.

        `raced_on` of the gaits are simulated in every scenario. Each other one costs at least as much as the
        worst of these, and its status says that it was dropped.

        Args:
            gaits: the gaits.
            aim: what ranks them in the first scenario, the lowest first.
        """
        count = len(self.setup.scenarios)
        if count == 1:
            return self(gaits)
        first = self.outcomes(gaits, [0])
        alone = [self._judged(row) for row in first]
        ranked = sorted(range(len(gaits)), key=lambda i: (aim(alone[i]), i))
        kept = sorted(ranked[: math.ceil(self.raced_on * len(gaits))])
        rest = self.outcomes([gaits[i] for i in kept], range(1, count))
        rows = {i: first[i] + others for i, others in zip(kept, rest, strict=True)}
        judged = {i: self._judged(row) for i, row in rows.items()}
        worst = max((e.cost for e in judged.values() if e.status == "ok"), default=-math.inf)
        return [
            Evaluated(judged[i], rows[i])
            if i in rows
            else Evaluated(_dropped(alone[i], worst, count), first[i])
            for i in range(len(gaits))
        ]


def simulated_s(judged: Sequence[Evaluated]) -> float:
    """Return the simulated seconds of some gaits in all."""
    return sum(outcome.simulated_s for one in judged for outcome in one.outcomes)


def _dropped(evaluation: Evaluation, worst: float, count: int) -> Evaluation:
    if evaluation.status != "ok":
        return evaluation
    return replace(
        evaluation, cost=max(evaluation.cost, worst), status=f"{DROPPED} after 1 of {count} scenarios"
    )
