"""The race over scenarios: clear losers see one scenario; the other gaits are judged as without a race."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import DROPPED, RACED_ON, Evaluator
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.notes import failure_notes
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.study import Study
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.simulation.objective import FAILED_COST
from gaitopt.simulation.setup import RobotSetup

BUDGET = 30


@pytest.fixture(scope="module")
def varied(strider: Problem) -> Problem:
    """The strider, searched over three scenarios."""
    spread = strider.file.scenarios.model_copy(update={"search": 3})
    file = strider.file.model_copy(update={"scenarios": spread})
    return Problem.from_file(file, strider.source, strider.model_path)


def setting(problem: Problem) -> RobotSetup:
    return RobotSetup.of(
        problem, scenarios_of(problem, 1, Stream.SEARCH_SCENARIOS), problem.simulation.working
    )


def gaits_of(problem: Problem) -> list[Gait]:
    return [problem.space.decode(point) for point in quasi_random(problem.space, 12, 1)]


def test_the_worst_in_the_first_scenario_see_no_other(varied: Problem) -> None:
    evaluator = Evaluator(setting(varied), SerialExecutor())
    gaits = gaits_of(varied)
    raced, whole = evaluator.race(gaits), evaluator(gaits)
    alone = [one.evaluation.cost for one in Evaluator(_first(varied), SerialExecutor())(gaits)]
    kept = set(np.argsort(alone, kind="stable")[: math.ceil(RACED_ON * len(gaits))].tolist())
    worst = max(raced[i].evaluation.cost for i in kept)
    assert len(kept) == 8
    for i, (one, other) in enumerate(zip(raced, whole, strict=True)):
        evaluation = one.evaluation
        if i in kept:
            assert one == other
        else:
            assert one.outcomes == other.outcomes[:1]
            assert evaluation.status == "dropped after 1 of 3 scenarios"
            assert not evaluation.constraints_met
            assert evaluation.cost == max(alone[i], worst)


def _first(problem: Problem) -> RobotSetup:
    return RobotSetup.of(
        problem, scenarios_of(problem, 1, Stream.SEARCH_SCENARIOS)[:1], problem.simulation.working
    )


def test_over_one_scenario_nobody_is_dropped(strider: Problem) -> None:
    evaluator = Evaluator(_first(strider), SerialExecutor())
    gaits = gaits_of(strider)
    assert evaluator.race(gaits) == evaluator(gaits)


def test_a_gait_that_fails_keeps_its_reason(varied: Problem) -> None:
    exploding = varied.with_parameters({"k_servo": 1e7, "torque_limit": 1e12})
    raced = Evaluator(setting(exploding), SerialExecutor()).race(gaits_of(exploding)[:6])
    assert {(one.evaluation.cost, one.evaluation.status) for one in raced} == {
        (FAILED_COST, "diverged: badqacc")
    }


def searched(problem: Problem, path: Path, workers: int = 1) -> str:
    """The journal of a search, resumed where `path` holds one."""
    with open_executor("threads", workers) as executor:
        Study(Evaluator(setting(problem), executor), Journal(path, problem), BUDGET, 1).run()
    return path.read_text()


@pytest.fixture(scope="module")
def whole(varied: Problem, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The journal of an uninterrupted search."""
    return searched(varied, tmp_path_factory.mktemp("whole") / "evaluations.csv")


def test_only_populations_race(whole: str) -> None:
    """The first batch and the polish see every scenario; the best gait always does."""
    rows = list(csv.DictReader(whole.splitlines()))
    dropped = [row for row in rows if row["status"].startswith("dropped")]
    assert {row["method"] for row in dropped} == {"cma-es"}
    most = max(float(row["simulated_s"]) / float(row["period_s"]) for row in dropped)
    assert len(dropped) >= 3
    assert most < max(float(row["simulated_s"]) / float(row["period_s"]) for row in rows)
    assert min(rows, key=lambda row: float(row["cost"]))["status"] == "ok"


def test_to_be_dropped_is_not_to_fail(varied: Problem, whole: str, tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text(whole)
    entries = Journal(path, varied).entries
    assert any(entry.evaluation.status.startswith(DROPPED) for entry in entries)
    assert failure_notes(entries) == ()
    stuck = [replace(entry, evaluation=replace(entry.evaluation, status="stuck")) for entry in entries[:2]]
    assert failure_notes([*entries[2:], *stuck]) == (
        f"2 of {len(entries)} gaits failed in simulation: stuck (2)",
    )


@pytest.mark.parametrize("rows", [1, 4, 9, 16, BUDGET])
def test_a_search_cut_inside_a_race_ends_with_the_same_bits(
    varied: Problem, whole: str, tmp_path: Path, rows: int
) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text("".join(whole.splitlines(keepends=True)[: 1 + rows]))
    assert searched(varied, path) == whole


def test_workers_change_no_bit_of_a_race(varied: Problem, whole: str, tmp_path: Path) -> None:
    assert searched(varied, tmp_path / "evaluations.csv", workers=3) == whole
