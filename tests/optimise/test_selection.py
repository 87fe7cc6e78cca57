"""The winner among the best gaits of a search, by fresh scenarios and by its limits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from gaitopt.core.progress import Progress
from gaitopt.gait.gait import Gait
from gaitopt.optimise import selection
from gaitopt.optimise.evaluator import Evaluator, Outcome
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.journal import Entry
from gaitopt.optimise.selection import CONFIRMATION, Finalist, Finalists, finalists, select
from gaitopt.problem.objective import Constraint
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import SPEED, measure, metric_names
from gaitopt.simulation.objective import Evaluation
from gaitopt.simulation.rollout import Simulator


def entry(problem: Problem, index: int, point: np.ndarray, cost: float, status: str = "ok") -> Entry:
    evaluation = Evaluation(cost, {}, {}, status)
    return Entry(index, "cma-es", point, problem.space.decode(point), evaluation, 1.0)


def test_others_are_unlike_the_leaders_and_each_other(strider: Problem) -> None:
    middle = np.full(len(strider.space.variables), 0.5)

    def at(step: float) -> np.ndarray:
        point = middle.copy()
        point[0] += step
        return point

    steps = [0.0, 0.01, 0.02, 0.3, 0.31, -0.3, 0.05]
    entries = [entry(strider, i, at(step), float(i)) for i, step in enumerate(steps)]
    found = finalists([*entries, entry(strider, 9, at(0.5), -1.0, "diverged")], [], 2, strider.space)
    assert [one.gait for one in found.leaders] == [entries[0].gait, entries[1].gait]
    assert [one.gait for one in found.others] == [entries[3].gait, entries[5].gait]


def speed(problem: Problem, gait: Gait) -> float:
    robot = Simulator.build(problem)
    return measure(problem, gait, robot.run(gait), Robot.of(robot.models[0]))[SPEED.name]


@pytest.mark.parametrize("share", [0.5, 20.0])
def test_the_others_are_tried_where_the_leaders_break_a_limit(strider: Problem, share: float) -> None:
    """A limit on the speed that the faster gait breaks, or that both keep."""
    gaits = sorted(strider.baselines.values(), key=lambda gait: speed(strider, gait))
    slow, fast = gaits[0], gaits[-1]
    limit = speed(strider, slow) + share * (speed(strider, fast) - speed(strider, slow))
    limits = {SPEED.name: Constraint(max=limit, scale=1e-3)}
    objective = strider.objective.model_copy(update={"constraints": limits, "search_margin": 0.0})
    problem = replace(strider, file=strider.file.model_copy(update={"objective": objective}))
    with open_executor("serial", 1) as pool:
        found = select(problem, Finalists([Finalist(fast, "fast")], [Finalist(slow, "slow")]), pool, 1)
        alone = select(problem, Finalists([Finalist(fast, "fast")]), pool, 1)
    assert found.found_by == ("slow" if share < 1.0 else "fast")
    assert alone.found_by == "fast"
    assert (found.simulated_s > alone.simulated_s) == (share < 1.0)


def test_a_gait_that_keeps_the_limits_wins_over_a_faster_one_that_breaks_one(strider: Problem) -> None:
    """Although the penalty is smaller than the difference in speed."""
    gaits = sorted(strider.baselines.values(), key=lambda gait: speed(strider, gait))
    slow, fast = gaits[0], gaits[-1]
    limit = 0.5 * (speed(strider, slow) + speed(strider, fast))
    limits = {SPEED.name: Constraint(max=limit, scale=1.0)}
    changes = {"constraints": limits, "search_margin": 0.0, "penalty": 1e-6}
    objective = strider.objective.model_copy(update=changes)
    problem = replace(strider, file=strider.file.model_copy(update={"objective": objective}))
    with open_executor("serial", 1) as pool:
        found = select(problem, Finalists([Finalist(fast, "fast"), Finalist(slow, "slow")]), pool, 1)
        others = select(problem, Finalists([Finalist(fast, "fast")], [Finalist(slow, "slow")]), pool, 1)
    assert found.found_by == others.found_by == "slow"


def test_the_others_are_tried_although_a_baseline_keeps_the_limits(strider: Problem) -> None:
    """Group by group, until one of the search keeps them, too; a baseline that is slower does not win."""
    gaits = sorted(strider.baselines.values(), key=lambda gait: speed(strider, gait))
    slow, fast = gaits[0], gaits[-1]
    still = Gait(
        slow.period_s,
        {name: c.model_copy(update={"amplitude_deg": 0.0}) for name, c in slow.channels.items()},
    )
    limit = 0.5 * (speed(strider, slow) + speed(strider, fast))
    limits = {SPEED.name: Constraint(max=limit, scale=1.0)}
    changes = {"constraints": limits, "search_margin": 0.0, "penalty": 1.0}
    objective = strider.objective.model_copy(update=changes)
    problem = replace(strider, file=strider.file.model_copy(update={"objective": objective}))
    others = [Finalist(fast, "again"), Finalist(slow, "slow"), Finalist(slow, "not tried")]
    among = Finalists([Finalist(fast, "fast")], others, Finalist(still, "baseline"))
    assert [len(group) for group in among.groups] == [1, 1, 1, 1]
    steps: list[Progress] = []
    with open_executor("serial", 1) as pool:
        found = select(problem, among, pool, 1, steps.append)
    assert found.found_by == "slow"
    counted = [step.done for step in steps if step.stage == CONFIRMATION]
    anew = problem.file.scenarios.verification
    # "again", "slow", and "slow" anew; "not tried" not at all
    assert counted == list(range(2 * 8 + anew + 1))


@dataclass(frozen=True)
class Flattering(Evaluator):
    """Gives gaits a speed by their periods; that of 0.5 s is half as fast at the reference fidelity."""

    def outcomes(self, gaits: Sequence[Gait], scenarios: Sequence[int] | None = None) -> list[list[Outcome]]:
        working = self.setup.fidelity == self.setup.problem.simulation.working
        metrics = dict.fromkeys(metric_names(self.setup.problem), 0.0)
        rows = []
        for gait in gaits:
            lost = 0.0 if working else 0.1 * (gait.period_s == 0.5)
            rows.append([Outcome(metrics | {SPEED.name: 0.2 - 0.1 * gait.period_s - lost}, "ok", 2.0)])
        return rows


def test_the_best_must_stay_the_best_at_the_reference_fidelity(
    strider: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And each that takes its place must, too."""
    monkeypatch.setattr(selection, "Evaluator", Flattering)
    channels = next(iter(strider.baselines.values())).channels
    lucky, steady, slow = (Gait(period, channels, str(period)) for period in (0.5, 0.7, 0.9))
    among = Finalists([Finalist(one, one.name) for one in (slow, lucky, steady)])
    with open_executor("serial", 1) as pool:
        found = select(strider, among, pool, 1)
    assert found.found_by == "0.7"
    assert found.gait.period_s == 0.7
    assert found.simulated_s == 5 * 2.0  # three at the working fidelity, two at the reference
