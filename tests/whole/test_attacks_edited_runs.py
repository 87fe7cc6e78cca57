"""Attacks with a run folder whose files were edited: its journal, request, summary and diagnosis."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from edited_runs import deep
from ending import small_trials
from helpers import STRIDER, edited, problem_folder
from hostility import run

from gaitopt.cli import app as cli
from gaitopt.diagnose.diagnosis import DiagnosisRequest
from gaitopt.jobs.diagnose import Question
from gaitopt.optimise.journal import _digest, _line
from gaitopt.problem.problem import load_problem
from gaitopt.runs.run_folder import RunFolder


def resigned(path: Path, folder: Path, change: Callable[[list[str]], object]) -> None:
    """Change the second row of a journal and give it a right digest, as who knows the code can."""
    journal = RunFolder.reopen(folder).folder.open_journal(load_problem(folder))
    lines = path.read_bytes().split(b"\n")
    before = lines[1].rpartition(b",")[2].decode()
    cells = journal._cells(journal.entries[1])
    change(cells)
    row = _line(cells)
    lines[2] = row + b"," + _digest(before, row).encode()
    path.write_bytes(b"\n".join(lines[:3]) + b"\n")


def cell(name: str, value: str) -> Callable[[Path, Path], None]:
    def change(path: Path, folder: Path) -> None:
        header = path.read_text().splitlines()[0].split(",")
        resigned(path, folder, lambda cells: cells.__setitem__(header.index(name), value))

    return change


FORGED = {
    "NaN cost": (cell("cost", "nan"), "line 3: a cost or a simulated time that is not a number"),
    "infinite cost": (cell("cost", "-inf"), "line 3: a cost or a simulated time"),
    "doubled id": (cell("evaluation", "0"), "line 3: evaluation: found 0; allowed: 1"),
    "id of 4,000 digits": (cell("evaluation", "9" * 4000), "line 3: evaluation: found"),
    "id of 9,000 digits": (cell("evaluation", "9" * 9000), "line 3: Exceeds the limit"),
    "cost of 4,000 digits": (cell("cost", "9" * 4000), "line 3: a cost or a simulated time"),
    "cell of 200,000 characters": (cell("status", "x" * 200_000), "line 3: field larger than field limit"),
    "unknown rung": (cell("rung", "cellar"), "evaluation 1 is not the one that this seed"),
    "another method": (cell("method", "pareto"), "evaluation 1 is not the one that this seed"),
    "digits of another script": (cell("cost", "\u0661"), "line 3: its numbers do not belong together"),
    "underscores": (cell("cost", "1_000.0"), "line 3: its numbers do not belong together"),
    "constraints met": (cell("constraints_met", "perhaps"), "line 3: its numbers do not belong together"),
    "another period": (cell("period_s", "7.0"), "line 3: its numbers do not belong together"),
    "NaN time": (cell("simulated_s", "nan"), "line 3: a cost or a simulated time that is not a number"),
    "too few cells": (
        lambda path, folder: resigned(path, folder, lambda cells: cells.pop()),
        " cells, not ",
    ),
}


@pytest.mark.parametrize("forged", FORGED)
def test_a_forged_row_with_a_right_digest_is_one_line(forged: str, unfinished: Path, capsys: Any) -> None:
    change, said = FORGED[forged]
    change(unfinished / "evaluations.csv", unfinished)
    before = (unfinished / "evaluations.csv").read_bytes()
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert (code, said in err) == (1, True), err
    assert len(err) < 700
    assert (unfinished / "evaluations.csv").read_bytes() == before


def swapped(lines: list[bytes]) -> None:
    lines[1], lines[2] = lines[2], lines[1]


def digit(lines: list[bytes]) -> None:
    """Change one digit of a metric."""
    cells = lines[2].split(b",")
    cells[8] = cells[8].translate(bytes.maketrans(b"12345678", b"23456781"))
    lines[2] = b",".join(cells)


EDITED = {
    "one digit": digit,
    "doubled": lambda lines: lines.insert(2, lines[1]),
    "reordered": swapped,
    "removed in the middle": lambda lines: lines.pop(1),
    "NaN cost": lambda lines: lines.__setitem__(
        1, lines[1].replace(b",quasi-random,", b",quasi-random,nan,")
    ),
    "another digest": lambda lines: lines.__setitem__(3, lines[3][:-1] + b"x"),
    "no digest": lambda lines: lines.__setitem__(3, lines[3].rpartition(b",")[0]),
    "an empty line": lambda lines: lines.insert(2, b""),
    "a cell of 200,000 characters": lambda lines: lines.__setitem__(2, lines[2] + 200_000 * b"x"),
    "no UTF-8": lambda lines: lines.__setitem__(2, b"\xff" + lines[2]),
    "line ends of another system": lambda lines: lines.__setitem__(2, lines[2] + b"\r"),
}


@pytest.mark.parametrize("name", EDITED)
def test_a_row_that_was_changed_is_one_line(name: str, unfinished: Path, capsys: Any) -> None:
    path = unfinished / "evaluations.csv"
    lines = path.read_bytes().split(b"\n")
    EDITED[name](lines)
    path.write_bytes(b"\n".join(lines))
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert code == 1
    assert "its digest is not that of this row after the rows before it" in err
    assert path.read_bytes() == b"\n".join(lines)


def test_rows_beyond_the_budget_are_one_line(unfinished: Path, finished_folder: Path, capsys: Any) -> None:
    """Even where a journal of a longer run is given the right digests."""
    path = unfinished / "evaluations.csv"
    edited(unfinished / "run.toml", "budget = 6", "budget = 2")
    entries = RunFolder.reopen(finished_folder).folder.open_journal(load_problem(finished_folder)).entries
    path.unlink()
    RunFolder.reopen(unfinished).folder.open_journal(load_problem(unfinished)).append(entries)
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert code == 1
    assert "evaluations; allowed: 2" in err or "is not the one that this seed, budget" in err


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("problem.toml", "[simulation", "# a comment\n[simulation"),
        ("model.xml", "<mujoco", "<!-- a comment --><mujoco"),
        ("run.toml", "seed = 5", "seed = 6"),
        ("run.toml", "budget = 6", "budget = 7"),
    ],
)
def test_a_journal_belongs_to_the_files_beside_it(
    name: str, old: str, new: str, unfinished: Path, capsys: Any
) -> None:
    text = (unfinished / name).read_text()
    assert old in text
    (unfinished / name).write_text(text.replace(old, new, 1))
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert (code, "line 2: its digest" in err) == (1, True)


def test_a_journal_of_an_earlier_version_is_refused(unfinished: Path, capsys: Any) -> None:
    path = unfinished / "evaluations.csv"
    path.write_text("".join(line.rpartition(",")[0] + "\n" for line in path.read_text().splitlines()))
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert code == 1
    assert "no column digest: the run is of an earlier version; cannot resume" in err


def test_a_finished_run_of_an_earlier_version_is_printed(finished: Path, capsys: Any) -> None:
    path = finished / "evaluations.csv"
    path.write_text("".join(line.rpartition(",")[0] + "\n" for line in path.read_text().splitlines()))
    assert run(capsys, "optimise", finished, "--resume", finished, "--quiet") == (0, "")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seed = 5", "seed = -1", "run.toml: seed: found -1; allowed: 0 or more"),
        ("budget = 6", "budget = 0", "run.toml: budget: found 0; allowed: 1 to"),
        ("budget = 6", "budget = " + "9" * 4000, "run.toml: budget: found"),
        ("seed = 5", "seed = " + "9" * 4301, "run.toml: not TOML"),
        ('method = "default"', 'method = "deafult"', "run.toml: method: found 'deafult'; allowed: default"),
        ("seed = 5", "seed = " + "[" * 300 + "]" * 300, "run.toml: nested too deep"),
        ("seed = 5", "seed = true", "run.toml: seed: found True; allowed: int"),
    ],
)
def test_a_request_out_of_range_is_one_line(
    old: str, new: str, said: str, unfinished: Path, capsys: Any
) -> None:
    edited(unfinished / "run.toml", old, new)
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert (code, said in err) == (1, True), err


SUMMARIES: dict[str, Callable[[dict[str, Any]], object]] = {
    "null interval": lambda c: c["best"].update(speed_ci90_m_s=None),
    "null ends": lambda c: c["best"].update(speed_ci90_m_s=[None, None]),
    "no baselines": lambda c: c.update(baselines=[]),
    "null baselines": lambda c: c.pop("baselines"),
    "null best": lambda c: c.update(best=None),
    "900 deep": lambda c: c.update(extra=deep(900)),
    "notes 90 deep": lambda c: c.update(notes=deep(90)),
    "a speed of 4,000 digits": lambda c: c["best"].update(speed_m_s=10**4000),
    "a seed of 4,000 digits": lambda c: c.update(seed=10**4000),
    "null period": lambda c: c["best"].update(period_s=None),
    "a ratio of 4,000 digits": lambda c: c.update(ratio_to_best_baseline=10**4000),
    "null speeds": lambda c: [row.update(speed_m_s=None) for row in [c["best"], *c["baselines"]]],
    "a name of control characters": lambda c: c["best"].update(name="\x1b[31mred\u202e"),
    "a list": lambda c: c.clear(),
}


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("name", SUMMARIES)
def test_an_edited_summary_is_printed_or_one_line(
    name: str, as_json: bool, finished: Path, capsys: Any
) -> None:
    path = finished / "summary.json"
    content = json.loads(path.read_text())
    SUMMARIES[name](content)
    path.write_text(json.dumps(content))
    capsys.readouterr()
    code = cli.main(["optimise", str(finished), "--resume", str(finished), *(["--json"] if as_json else [])])
    out, err = capsys.readouterr()
    assert code == err.count("\n")
    assert "nan" not in out.lower()
    assert "\x1b" not in out
    assert "\u202e" not in out


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("extra", [deep(900), 10**4000, {"a": deep(90)}])
def test_an_edited_diagnosis_is_printed_or_one_line(
    extra: Any, as_json: bool, tmp_path: Path, capsys: Any
) -> None:
    content = {"answer": "No gap.", "explanation": ["a"], "extra": extra}
    (tmp_path / "diagnosis.json").write_text(json.dumps(content))
    words = ["diagnose", str(STRIDER), "trials", "--resume", str(tmp_path)]
    code = cli.main([*words, *(["--json"] if as_json else [])])
    _, err = capsys.readouterr()
    assert code == err.count("\n")


CHANGES = {
    "a parameter": ("robot/problem.toml", "value = 0.5", "value = 0.6"),
    "the model": ("robot/strider.xml", 'name="rear"', 'name="rear" gear="1"'),
    "a sample": ("trials/walk.csv", "\n0.2,", "\n0.20001,"),
    "the data set": ("trials/dataset.toml", "starts_at_gait_time_s = 0.0", "starts_at_gait_time_s = 0.1"),
    "the seed": ("", "", ""),
}


def question(folder: Path) -> Question:
    return Question.of(load_problem(folder / "robot"), folder / "trials", DiagnosisRequest(seed=1))


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """A folder with a problem, its data set, and the folder ``run`` of a diagnosis that was killed."""
    problem_folder(tmp_path / "robot", STRIDER)
    small_trials(tmp_path / "trials")
    (tmp_path / "run").mkdir()
    question(tmp_path).cache(tmp_path / "run").write("one", {"whitened": np.ones(3)})
    return tmp_path


@pytest.mark.parametrize("changed", CHANGES)
def test_a_diagnosis_goes_on_with_what_it_began_with_alone(changed: str, begun: Path, capsys: Any) -> None:
    """An edited problem, model or recording, or another seed, is one line, and its folder stays as it is."""
    name, old, new = CHANGES[changed]
    if name:
        edited(begun / name, old, new)
    before = [(path, path.stat().st_mtime_ns) for path in sorted((begun / "run").rglob("*"))]
    words = ("diagnose", begun / "robot", begun / "trials", "--seed", 1 if name else 2)
    code, err = run(capsys, *words, "--resume", begun / "run", "--quiet")
    assert (code, "nothing was simulated there with this problem, data set and seed" in err) == (1, True), err
    assert [(path, path.stat().st_mtime_ns) for path in sorted((begun / "run").rglob("*"))] == before


def test_a_comment_in_a_problem_changes_no_diagnosis(begun: Path) -> None:
    edited(begun / "robot" / "problem.toml", "[simulation", "# a comment\n[simulation")
    edited(begun / "robot" / "strider.xml", "<mujoco", "<!-- a comment --><mujoco")
    assert question(begun).cache(begun / "run").read("one") is not None


def test_a_finished_diagnosis_is_printed_whatever_became_of_its_problem(begun: Path, capsys: Any) -> None:
    shutil.rmtree(next((begun / "run").glob("simulated-*")))
    (begun / "run" / "report.html").touch()
    (begun / "run" / "diagnosis.json").write_text('{"answer": "No gap.", "explanation": []}')
    (begun / "robot" / "problem.toml").write_text("edited")
    words = ["diagnose", str(begun / "robot"), str(begun / "trials"), "--resume", str(begun / "run")]
    assert cli.main(words) == 0
    assert "No gap." in capsys.readouterr().out
