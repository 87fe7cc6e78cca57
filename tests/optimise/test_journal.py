"""The journal: a row per gait, on disk as soon as its batch is done, read back to the last bit."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from searching import BUDGET, run

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import Progress
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.recorder import SearchProgress
from gaitopt.optimise.run import Request, optimise
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.objective import Evaluation


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
    metrics = {n: 0.1 + 0.2 + i for i, n in enumerate(metric_names(strider))}
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

    def on_progress(progress: Progress) -> None:
        if not isinstance(progress, SearchProgress):
            return
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


def test_a_torn_header_is_written_again(strider: Problem, tmp_path: Path, whole: tuple[str, str]) -> None:
    path = tmp_path / "evaluations.csv"
    for beginning in ("", "evaluation,meth"):
        path.write_text(beginning)
        assert Journal(path, strider).entries == []
        assert path.read_text() == whole[0].splitlines(keepends=True)[0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda rows: ["a,b", *rows[1:]], "columns are not those of this problem and version; cannot resume"),
        (lambda rows: [rows[0], rows[1], "1,2,3", *rows[2:]], "line 3: its digest is not that of this row"),
        (
            lambda rows: [rows[0], rows[1].replace("quasi-random,", "quasi-random,cheap"), *rows[2:]],
            "line 2: its digest is not that of this row",
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
