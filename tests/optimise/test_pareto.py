"""Speed against cost of transport."""

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER, still
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.cli import app as cli
from gaitopt.optimise import pareto
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.run import Request, optimise
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.run_folder import RunFolder
from gaitopt.runs.summary import Summary
from gaitopt.simulation.objective import Evaluation

NUMBERS = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=12)


def entry(problem: Problem, index: int, speed: float, cost: float, violation: float = 0.0) -> Entry:
    """A gait as if it had been evaluated."""
    metrics = {"speed_m_s": speed, "cost_of_transport": cost}
    evaluation = Evaluation(-speed, metrics, {"tilt_rad": violation}, "ok")
    return Entry(index, "pareto", np.zeros(1), still(problem), evaluation, 1.0)


# --- the front --------------------------------------------------------------------------------


@given(NUMBERS)
def test_efficient_is_what_nothing_beats(numbers: Sequence[tuple[int, int]]) -> None:
    speeds, costs = [s for s, _ in numbers], [c for _, c in numbers]
    kept = pareto.efficient(speeds, costs)
    for i, (speed, cost) in enumerate(numbers):
        beaten = any(s >= speed and c <= cost and (s, c) != (speed, cost) for s, c in numbers)
        assert kept[i] == (not beaten and numbers.index((speed, cost)) == i)


def test_the_front_holds_what_keeps_the_limits_and_goes_forward(strider: Problem) -> None:
    rows = [(0.3, 9.0), (0.1, 2.0), (0.2, 3.0), (0.15, 4.0), (-0.1, 0.5), (0.1, math.inf)]
    entries = [entry(strider, i, *row) for i, row in enumerate(rows)]
    entries.append(entry(strider, 6, 0.9, 1.0, violation=0.1))
    front = pareto.front_of(entries)
    assert [e.index for e in front] == [1, 2, 0]
    assert pareto.limits(entries) == pytest.approx([2.0 * 4.5 ** (k / 4) for k in (1, 2, 3)])
    assert pareto.limits(entries[:1]) == []


def test_an_aim_puts_limits_before_what_it_aims_at(strider: Problem) -> None:
    """Within the limit the faster gait is better. Beyond it, the nearer one is better, and all are worse."""
    aim = pareto.fastest_within(3.0)
    inside = [entry(strider, 0, 0.1, 2.0), entry(strider, 1, 0.2, 3.0)]
    outside = [entry(strider, 2, 0.9, 3.3), entry(strider, 3, 0.9, 6.0), entry(strider, 4, 0.9, math.inf)]
    values = [aim(e) for e in inside + outside]
    assert values[1] == -0.2 < values[0] == -0.1 < min(values[2:])
    assert values[2] < values[3] < values[4]
    assert pareto.cheapest(inside[0]) == 2.0 < pareto.cheapest(entry(strider, 5, 1.0, 1.0, violation=0.01))


def test_a_long_front_is_thinned_evenly_with_its_ends(strider: Problem) -> None:
    entries = [entry(strider, i, 0.01 * (i + 1), math.exp(0.1 * i)) for i in range(30)]
    chosen = [e.index for e in pareto.thinned(pareto.front_of(entries))]
    assert (chosen[0], chosen[-1], len(chosen)) == (0, 29, pareto.FrontSettings.shown)
    assert np.ptp(np.diff(chosen)) <= 1
    assert [e.index for e in pareto.thinned(entries[:3])] == [0, 1, 2]


@pytest.fixture(scope="module")
def fronted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with a front."""
    folder = tmp_path_factory.mktemp("front") / "run"
    arguments = ["--budget", "64", "--seed", "1", "--pareto", "--out", str(folder), "--quiet"]
    assert cli.main(["optimise", str(STRIDER), *arguments]) == 0
    return folder


def test_a_front_is_gaits_and_figures_in_the_run_folder(fronted: Path) -> None:
    summary = json.loads((fronted / "summary.json").read_text())
    rows = list(csv.DictReader((fronted / "pareto.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == [f"front-{i + 1}" for i in range(len(rows))]
    assert 1 <= len(rows) <= pareto.FrontSettings.shown
    assert [found["name"] for found in summary["pareto"]] == [row["name"] for row in rows]
    kept = [row for row in rows if row["on_front"] == "true"]
    assert all(row["constraints_met"] == "true" for row in kept)
    pairs = sorted((float(row["speed_m_s"]), float(row["cost_of_transport"])) for row in kept)
    assert pairs == sorted(pairs, key=lambda pair: pair[1])
    journal = list(csv.DictReader((fronted / "evaluations.csv").read_text().splitlines()))
    assert len(journal) == 64
    assert sum(row["method"] == "pareto" for row in journal) == 32
    problem = load_problem(fronted)
    for row in rows:
        gait = problem.find_gait(str(fronted / "pareto" / f"{row['name']}.toml"))
        assert gait.period_s == float(row["period_s"])
        assert float(journal[int(row["evaluation"])]["cost_of_transport"]) == float(
            row["searched_cost_of_transport"]
        )
    page = (fronted / "report.html").read_text()
    assert (fronted / "figures" / "pareto.png").is_file()
    assert "Speed against cost of transport" in page


def test_a_front_is_cheaper_at_its_end_than_the_search_for_speed(fronted: Path) -> None:
    """With so small a budget it is so with six of the seeds 1 to 8."""
    journal = list(csv.DictReader((fronted / "evaluations.csv").read_text().splitlines()))

    def cheapest(front: bool) -> float:
        rows = [row for row in journal if row["constraints_met"] == "true" and float(row["speed_m_s"]) > 0.0]
        return min(float(r["cost_of_transport"]) for r in rows if (r["method"] == "pareto") == front)

    assert cheapest(front=True) < cheapest(front=False)


def test_an_interrupted_front_is_resumed_to_the_same_bits(
    fronted: Path, tmp_path: Path, strider: Problem
) -> None:
    for name in ("run.toml", "problem.toml", "model.xml"):
        (tmp_path / name).write_bytes((fronted / name).read_bytes())
    path = tmp_path / "evaluations.csv"
    lines = (fronted / "evaluations.csv").read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:45]))
    run = RunFolder.reopen(tmp_path)
    optimised = optimise(strider, run.request, run.folder.open_journal(run.problem), SerialExecutor())
    assert path.read_text() == "".join(lines)
    found = json.loads((fronted / "summary.json").read_text())["pareto"]
    assert Summary.of(strider, optimised).to_dict()["pareto"] == found


@pytest.mark.parametrize(("budget", "seed"), [(1, 1), (2, 1), (5, 1), (9, 1), (16, 2), (30, 3)])
def test_a_front_spends_its_budget(strider: Problem, tmp_path: Path, budget: int, seed: int) -> None:
    """Two gaits within the limits, and so a front, may be found late, or not at all."""
    request = Request(seed=seed, budget=budget, pareto=True)
    optimised = optimise(strider, request, Journal(tmp_path / "e.csv", strider), SerialExecutor())
    assert len(optimised.entries) == budget


def test_without_two_gaits_there_is_a_search_for_the_cheapest(strider: Problem, tmp_path: Path) -> None:
    """A robot that cannot keep its limits has no front; its budget is spent nevertheless."""
    limits = {"airtime": {"max": -1.0, "scale": 0.1}}
    objective = type(strider.file.objective).model_validate(
        strider.objective.model_dump() | {"constraints": limits}
    )
    file = strider.file.model_copy(update={"objective": objective})
    flying = Problem.from_file(file, strider.source, strider.model_path)
    request = Request(seed=1, budget=24, pareto=True)
    optimised = optimise(flying, request, Journal(tmp_path / "e.csv", flying), SerialExecutor())
    assert sum(entry.method == "pareto" for entry in optimised.entries) == 12
    assert optimised.front == []


def test_without_a_front_there_is_none(strider: Problem, tmp_path: Path) -> None:
    request = Request(seed=1, budget=2)
    optimised = optimise(strider, request, Journal(tmp_path / "e.csv", strider), SerialExecutor())
    assert optimised.front == []
    assert Summary.of(strider, optimised).pareto is None
