"""The study, its journal and its folder: nothing lost, nothing left to chance, resumable anywhere."""

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from helpers import still

from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.core.statistics import interval90
from gaitopt.core.streams import Stream
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.run import Optimised, Request, optimise
from gaitopt.optimise.stages import method_names
from gaitopt.optimise.study import SearchProgress
from gaitopt.optimise.verification import Verified, scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.runs.run_folder import RunFolder
from gaitopt.runs.summary import Summary
from gaitopt.simulation.objective import Evaluation

BUDGET = 24


def run(
    problem: Problem,
    path: Path,
    request: Request,
    workers: int = 1,
    executor: str = "threads",
    progress: list[SearchProgress] | None = None,
) -> Optimised:
    """Run the main job with its journal at `path`."""
    seen: list[SearchProgress] = [] if progress is None else progress
    with open_executor(executor, workers) as pool:
        return optimise(problem, request, Journal(path, problem), pool, seen.append)


def summary(problem: Problem, optimised: Optimised) -> str:
    """The summary without the one figure that is a clock's."""
    content = Summary.of(problem, optimised).to_dict()
    assert content.pop("wall_s") > 0.0
    return to_json(content)


@pytest.fixture(scope="module")
def whole(strider: Problem, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Journal and summary of an uninterrupted run."""
    path = tmp_path_factory.mktemp("whole") / "evaluations.csv"
    optimised = run(strider, path, Request(seed=3, budget=BUDGET))
    return path.read_text(), summary(strider, optimised)


# --- the journal ------------------------------------------------------------------------------


def test_a_row_per_gait_in_candidate_order(strider: Problem, tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    optimised = run(strider, path, Request(seed=3, budget=BUDGET))
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [int(row["evaluation"]) for row in rows] == list(range(BUDGET))
    methods = [row["method"] for row in rows]
    assert list(dict.fromkeys(methods)) == ["quasi-random", "cma-es", "nelder-mead"]
    assert methods == sorted(methods, key=["quasi-random", "cma-es", "nelder-mead"].index)
    for row, entry in zip(rows, optimised.entries, strict=True):
        assert float(row["cost"]) == entry.evaluation.cost
        assert float(row["speed_m_s"]) == entry.evaluation.metrics["speed_m_s"]
        assert float(row["period_s"]) == entry.gait.period_s
        assert float(row["rear.phase"]) == entry.gait.channels["rear"].phase
        assert float(row["front.amplitude_deg"]) == entry.gait.channels["front"].amplitude_deg
        assert float(row["simulated_s"]) == entry.simulated_s > 0.0
        assert row["constraints_met"] == ("true" if entry.evaluation.constraints_met else "false")
        variables = [v.name for v in strider.space.variables]
        assert [float(row[f"x.{name}"]) for name in variables] == entry.point.tolist()
        assert strider.check_gait(entry.gait, "journal") is not None


def test_a_journal_read_back_is_what_was_written(strider: Problem, tmp_path: Path) -> None:
    """Costs, points, failures and odd texts, to the last bit."""
    path = tmp_path / "evaluations.csv"
    point = np.random.default_rng(1).uniform(size=len(strider.space.variables)) - 3e-17
    journal = Journal(path, strider)
    names = journal.columns
    metrics = {n: 0.1 + 0.2 + i for i, n in enumerate(journal._metrics)}
    good = Evaluation(-1.0 / 3.0, metrics, {"airtime": 1.0 / 7.0, "tilt_rad": 0.0}, "ok")
    status = 'failed: "mj_step", a comma, and\na second line'
    bad = Evaluation(1e6, dict.fromkeys(metrics, math.nan), {}, status)
    gait = strider.space.decode(point)
    entries = [Entry(0, "cma-es", point, gait, good, 1.1), Entry(1, "nelder-mead", point, gait, bad, 0.0)]
    journal.append(entries[:1])
    journal.append(entries[1:])
    back = Journal(path, strider)
    assert back.columns == names
    assert len(back.entries) == 2
    for entry, other in zip(entries, back.entries, strict=True):
        assert (other.index, other.method, other.simulated_s) == (
            entry.index,
            entry.method,
            entry.simulated_s,
        )
        assert np.array_equal(other.point, entry.point)
        assert (other.gait.period_s, other.gait.channels) == (gait.period_s, gait.channels)
        assert other.evaluation.cost == entry.evaluation.cost
        assert repr(other.evaluation.metrics) == repr(entry.evaluation.metrics)
        assert other.evaluation.constraints_met == entry.evaluation.constraints_met
    assert back.entries[0].evaluation.violations == good.violations
    assert back.entries[1].evaluation.status == status.replace("\n", " ")
    assert len(path.read_text().splitlines()) == 3


def test_the_journal_is_there_from_the_first_second(strider: Problem, tmp_path: Path) -> None:
    """Its header before anything is evaluated, each batch as it ends."""
    path = tmp_path / "evaluations.csv"
    lengths: list[int] = []

    def on_progress(progress: SearchProgress) -> None:
        lengths.append(len(path.read_text().splitlines()) - 1)
        assert lengths[-1] == progress.done

    journal = Journal(path, strider)
    assert len(path.read_text().splitlines()) == 1
    with open_executor("serial") as executor:
        optimise(strider, Request(seed=3, budget=12), journal, executor, on_progress)
    assert lengths == sorted(set(lengths))
    assert lengths[-1] == 12


@pytest.mark.parametrize("torn", ["17,cma-es,0.1", "17", "evalu", '17,cma-es,"'])
def test_a_torn_last_line_is_dropped(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], torn: str
) -> None:
    path = tmp_path / "evaluations.csv"
    lines = whole[0].splitlines(keepends=True)
    path.write_text("".join(lines[:8]) + torn)
    assert len(Journal(path, strider).entries) == 7
    assert path.read_text() == "".join(lines[:8])


def test_a_torn_header_is_written_anew(strider: Problem, tmp_path: Path, whole: tuple[str, str]) -> None:
    path = tmp_path / "evaluations.csv"
    for beginning in ("", "evaluation,meth"):
        path.write_text(beginning)
        assert Journal(path, strider).entries == []
        assert path.read_text() == whole[0].splitlines(keepends=True)[0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda rows: ["a,b", *rows[1:]], "columns are not those of this problem and version; cannot resume"),
        (lambda rows: [rows[0], rows[1], "1,2,3", *rows[2:]], "line 3: 3 cells, not "),
        (
            lambda rows: [rows[0], rows[1].replace("quasi-random,", "quasi-random,cheap"), *rows[2:]],
            "line 2: could not convert string to float: 'cheap",
        ),
    ],
)
def test_a_spoiled_journal_is_one_line(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], spoil: object, message: str
) -> None:
    path = tmp_path / "evaluations.csv"
    assert callable(spoil)
    text = "\n".join(spoil(whole[0].splitlines())) + "\n"
    path.write_text(text)
    with pytest.raises(GaitoptError) as error:
        Journal(path, strider)
    assert str(error.value).startswith(f"{path}: {message}")
    assert path.read_text() == text


# --- the same bits ----------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [0, 1, 2, 3, 9, BUDGET - 2, BUDGET])
def test_a_resumed_run_ends_with_the_bits_of_a_whole_one(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], rows: int
) -> None:
    """Cut anywhere: in a batch, between methods, before the first row, after the last."""
    path = tmp_path / "evaluations.csv"
    path.write_text("".join(whole[0].splitlines(keepends=True)[: 1 + rows]))
    optimised = run(strider, path, Request(seed=3, budget=BUDGET))
    assert path.read_text() == whole[0]
    assert summary(strider, optimised) == whole[1]


def test_a_resumed_run_evaluates_only_what_is_missing(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text("".join(whole[0].splitlines(keepends=True)[:11]))
    asked: list[str] = []
    original = Journal.append

    def append(self: Journal, entries: Sequence[Entry]) -> None:
        asked.extend(str(entry.index) for entry in entries)
        original(self, entries)

    monkeypatch.setattr(Journal, "append", append)
    run(strider, path, Request(seed=3, budget=BUDGET))
    assert asked == [str(i) for i in range(10, BUDGET)]


@pytest.mark.parametrize(
    ("executor", "workers"), [("serial", 1), ("threads", 2), ("threads", 3), ("processes", 2)]
)
def test_workers_and_executors_change_no_bit(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], executor: str, workers: int
) -> None:
    path = tmp_path / "evaluations.csv"
    optimised = run(strider, path, Request(seed=3, budget=BUDGET), workers, executor)
    assert path.read_text() == whole[0]
    assert summary(strider, optimised) == whole[1]


def test_another_seed_is_another_search(strider: Problem, tmp_path: Path, whole: tuple[str, str]) -> None:
    run(strider, tmp_path / "evaluations.csv", Request(seed=4, budget=BUDGET))
    assert (tmp_path / "evaluations.csv").read_text() != whole[0]


@pytest.mark.parametrize("request_", [Request(seed=4, budget=BUDGET), Request(3, BUDGET, "cma-es")])
def test_a_journal_of_another_request_is_recognised(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], request_: Request
) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text(whole[0])
    with pytest.raises(GaitoptError) as error:
        run(strider, path, request_)
    assert str(error.value) == (
        f"{path}: evaluation 0 is not the one that this seed, budget and method propose; "
        "the run was made by other ones or by another version"
    )
    assert path.read_text() == whole[0]


# --- the search -------------------------------------------------------------------------------


@pytest.mark.parametrize("method", method_names())
@pytest.mark.parametrize("budget", [1, 2, 5, 13])
def test_every_method_spends_at_most_its_budget(
    strider: Problem, tmp_path: Path, method: str, budget: int
) -> None:
    progress: list[SearchProgress] = []
    path = tmp_path / "evaluations.csv"
    optimised = run(strider, path, Request(1, budget, method), progress=progress)
    assert len(optimised.entries) == budget
    if method != "default":
        assert {entry.method for entry in optimised.entries} == {method}
    assert progress[-1].done == progress[-1].total == budget
    bests = [p.best.evaluation.cost for p in progress if p.best is not None]
    assert bests == sorted(bests, reverse=True)
    assert optimised.found_by in {*method_names(), "quasi-random", *strider.baselines}


def test_the_search_beats_its_first_batch(strider: Problem, tmp_path: Path) -> None:
    optimised = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=150))
    first = [e.evaluation.cost for e in optimised.entries if e.method == "quasi-random"]
    assert min(entry.evaluation.cost for entry in optimised.entries) < min(first)
    assert optimised.best.speed > max(baseline.speed for baseline in optimised.baselines)


def test_the_winner_is_a_gait_of_the_search_or_the_best_baseline(strider: Problem, tmp_path: Path) -> None:
    """With a budget of one gait there are two finalists, and the winner is named after its finder."""
    optimised = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=1))
    (entry,) = optimised.entries
    expected = strider.baselines.get(optimised.found_by, entry.gait)
    assert (optimised.best.gait.period_s, optimised.best.gait.channels) == (
        expected.period_s,
        expected.channels,
    )
    assert optimised.found_by in {entry.method, *strider.baselines}


def test_the_winner_is_verified_on_scenarios_never_searched(strider: Problem, tmp_path: Path) -> None:
    optimised = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=4))
    assert scenarios_of(strider, 1, Stream.VERIFICATION_SCENARIOS)[-1].framed
    for verified in [optimised.best, *optimised.baselines]:
        assert verified.speeds.shape == (strider.file.scenarios.verification,)
        low, high = verified.speed_ci90
        assert low < verified.speed < high
        assert verified.worst <= verified.speed
    assert [verified.gait.name for verified in optimised.baselines] == list(strider.baselines)


def test_a_robot_without_baselines_is_searched(strider: Problem, tmp_path: Path) -> None:
    file = strider.file.model_copy(update={"baselines": {}})
    problem = Problem.from_file(file, strider.source, strider.model_path)
    optimised = run(problem, tmp_path / "evaluations.csv", Request(seed=1, budget=6))
    content = Summary.of(problem, optimised)
    assert content.baselines == ()
    assert content.ratio_to_best_baseline is None


def test_a_robot_that_always_fails_says_so(strider: Problem, tmp_path: Path) -> None:
    exploding = strider.with_parameters({"k_servo": 1e7, "torque_limit": 1e12})
    path = tmp_path / "evaluations.csv"
    with pytest.raises(GaitoptError) as error:
        run(exploding, path, Request(seed=1, budget=5))
    assert str(error.value) == "every one of 5 gaits failed in simulation: diverged: badqacc (5)"
    assert len(Journal(path, exploding).entries) == 5


def test_an_unknown_method_is_one_line(strider: Problem, tmp_path: Path) -> None:
    with pytest.raises(GaitoptError) as error:
        run(strider, tmp_path / "evaluations.csv", Request(method="cma"))
    assert str(error.value) == (
        "--method: found 'cma'; allowed: default, cma-es, nelder-mead (nearest: 'cma-es')"
    )


# --- the summary ------------------------------------------------------------------------------


def verified(problem: Problem, name: str, speeds: list[float], met: bool = True) -> Verified:
    """A gait as if it had been verified."""
    metrics = {"speed_m_s": float(np.mean(speeds))}
    status = "ok" if np.isfinite(speeds).all() else "diverged: badqacc"
    evaluation = Evaluation(0.0, metrics, {"airtime": 0.0 if met else 2.0}, status)
    gait = still(problem)
    return Verified(type(gait)(2.0, gait.channels, name), evaluation, np.array(speeds), 1.0)


def compared(problem: Problem, best: Verified, *baselines: Verified) -> dict:
    """The summary of a run with these results."""
    optimised = Optimised(
        request=Request(),
        entries=[],
        plan=None,
        warm_start=None,
        rank_correlation=None,
        notes=(),
        found_by="cma-es",
        best=best,
        baselines=list(baselines),
        simulated_s=7.0,
        wall_s=1.0,
    )
    return json.loads(to_json(Summary.of(problem, optimised).to_dict()))


def test_ratios_are_to_the_fastest_and_to_the_fastest_that_meets_the_constraints(strider: Problem) -> None:
    found = compared(
        strider,
        verified(strider, "best", [0.3, 0.5]),
        verified(strider, "slow", [0.1, 0.1]),
        verified(strider, "fast", [0.2, 0.2], met=False),
    )
    assert found["ratio_to_best_baseline"] == pytest.approx(2.0)
    assert found["ratio_to_best_feasible_baseline"] == pytest.approx(4.0)
    assert [row["constraints_met"] for row in found["baselines"]] == [True, False]
    assert found["baselines"][0]["stride_m"] == pytest.approx(0.2)
    assert found["best"]["speed_m_s"] == found["verified"]["speed_m_s"] == pytest.approx(0.4)
    assert found["verified"]["timestep_s"] == strider.simulation.reference.timestep_s


@pytest.mark.parametrize("order", [1, -1])
def test_a_failed_baseline_does_not_hide_the_others(strider: Problem, order: int) -> None:
    baselines = [verified(strider, "lost", [math.nan, 0.1]), verified(strider, "good", [0.2, 0.2])][::order]
    found = compared(strider, verified(strider, "best", [0.4, 0.4]), *baselines)
    assert found["ratio_to_best_baseline"] == pytest.approx(2.0)


def test_there_is_no_ratio_to_a_gait_that_does_not_go_forward(strider: Problem) -> None:
    found = compared(strider, verified(strider, "best", [0.4, 0.4]), verified(strider, "back", [-0.1, -0.1]))
    assert found["ratio_to_best_baseline"] is None


def test_the_interval_is_students() -> None:
    """Of 1, 2, 3: mean 2, standard error 1/sqrt(3), t(0.95, 2) = 2.920."""
    low, high = interval90(np.array([1.0, 2.0, 3.0]))
    half = 2.919986 / math.sqrt(3.0)
    assert (low, high) == pytest.approx((2.0 - half, 2.0 + half), rel=1e-6)
    assert interval90(np.array([2.0])) == (2.0, 2.0)


# --- the run folder ---------------------------------------------------------------------------


@pytest.mark.parametrize("existing", [False, True])
def test_a_run_that_ends_before_its_first_gait_leaves_nothing(
    strider: Problem, tmp_path: Path, existing: bool
) -> None:
    """Not even in a folder that was there and empty, which can be used again."""
    path = tmp_path / "run"
    if existing:
        path.mkdir()
    with pytest.raises(RuntimeError, match="stop"), RunFolder.create(path, strider, Request()) as folder:  # noqa: PT012
        Journal(folder.journal, strider)
        raise RuntimeError("stop")
    assert path.exists() == existing
    assert not existing or list(path.iterdir()) == []


def test_a_run_that_was_interrupted_early_can_be_resumed(strider: Problem, tmp_path: Path) -> None:
    """Reopening a folder whose journal has only a header, and stopping again, removes nothing."""
    path = tmp_path / "run"
    with RunFolder.create(path, strider, Request()) as folder:
        journal = folder.journal
        run(strider, journal, Request(seed=1, budget=2))
    journal.write_text(journal.read_text().splitlines(keepends=True)[0])
    reopened = RunFolder.reopen(path)
    with reopened.folder:
        pass
    assert reopened.request == Request()
    assert reopened.problem.file.parameters == strider.file.parameters
    assert {"run.toml", "problem.toml", "model.xml", "evaluations.csv"} == {p.name for p in path.iterdir()}


def test_two_runs_into_one_folder_are_refused(strider: Problem, tmp_path: Path) -> None:
    path = tmp_path / "run"
    with RunFolder.create(path, strider, Request()):
        before = sorted(p.name for p in path.iterdir())
        second = RunFolder.reopen(path).folder
        with pytest.raises(GaitoptError) as error, second:
            pytest.fail("a second run got in")
        assert str(error.value) == f"{path}: another run is working in this folder"
        with pytest.raises(GaitoptError, match="already holds a run"):
            RunFolder.create(path, strider, Request())
        assert sorted(p.name for p in path.iterdir()) == before


def test_json_is_strict() -> None:
    text = to_json({"a": [math.nan, math.inf, 1.0], 3: (True, None, "x")})
    assert json.loads(text, parse_constant=pytest.fail) == {"a": [None, None, 1.0], "3": [True, None, "x"]}
