"""Attacks with a folder of blind cases that a stranger sent: edited answers and truths, and links."""

import json
import math
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from helpers import STRIDER
from hostility import run

from gaitopt import blind_score
from gaitopt.blind.cases import nominal_files
from gaitopt.blind.scoring import sentences
from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.problem.problem import load_problem
from gaitopt.runs.folder import held

MAKE = ("blind", "make", STRIDER, "--cases", 1, "--kind", "none", "--gaits", "stride", "--seconds", 3)

Keys = tuple[str | int, ...]


def effect(name: str) -> dict[str, Any]:
    parameters = {"scale": {"value": 0.5, "ci90": [0.4, 0.6]}}
    row = {"name": name, "target": "all", "probability": 0.9, "parameters": parameters}
    return row | {"heldout_shrinkage": 0.9, "alike": 0.1}


ANSWER = {
    "verdict": "explained",
    "causes": ["servo_gain"],
    "ambiguous_with": ["servo_trim"],
    "effects": [effect("servo_gain"), effect("servo_trim")],
    "other_probability": 0.01,
    "gap": {"shrinkage": 0.9},
}
TRUTH = {
    "kind": "single",
    "effects": [{"name": "servo_gain", "target": "all", "parameters": {"scale": 0.5}}],
    "gap_over_floor": 10.0,
    "figures": {"fps": 30.0},
}


@pytest.fixture
def cases(tmp_path: Path) -> Path:
    """Three diagnosed cases of the strider."""
    folder = tmp_path / "cases"
    files = {f"nominal/{name}": data.decode() for name, data in nominal_files(load_problem(STRIDER)).items()}
    for index in range(3):
        files[f"sealed/case-00{index}.json"] = json.dumps(TRUTH)
        files[f"diagnoses/case-00{index}/diagnosis.json"] = json.dumps(ANSWER)
        files[f"diagnoses/case-00{index}/report.html"] = ""
        files[f"case-00{index}/dataset.toml"] = ""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def deep(levels: int) -> Any:
    value: Any = 1
    for _ in range(levels):
        value = [value]
    return value


REMOVED = object()
ODD = {
    "null": None,
    "true": True,
    "a text": "x",
    "a number as text": "1_000",
    "nothing": "",
    "a negative number": -1,
    "a number above one": 2,
    "the largest number": 1e308,
    "the smallest number": -1e308,
    "300 digits": 10**300,
    "400 digits": 10**400,
    "4,000 digits": 10**4000,
    "NaN": math.nan,
    "infinity": math.inf,
    "an empty list": [],
    "an empty table": {},
    "a list of nulls": [None, None],
    "another table": {"a": 1},
    "90 levels": deep(90),
    "900 levels": deep(900),
    "control characters": "\x1b[31m\u202e",
    "half a character": "\ud800",
    "a long text": "a" * 100_000,
    "missing": REMOVED,
}


def paths(value: Any, before: Keys = ()) -> Iterator[Keys]:
    """The way to each value inside a value, itself included."""
    yield before
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from paths(item, (*before, key))


def changed(value: Any, keys: Keys, new: Any) -> Any:
    if not keys:
        return new
    value = deepcopy(value)
    inner = value
    for key in keys[:-1]:
        inner = inner[key]
    if new is REMOVED:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = new
    return value


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("what", ["answer", "truth"])
def test_an_edited_case_is_scored_or_is_one_line(what: str, odd: str, cases: Path) -> None:
    name, good = (
        ("diagnoses/case-001/diagnosis.json", ANSWER) if what == "answer" else ("sealed/case-001.json", TRUTH)
    )
    refused = 0
    for keys in list(paths(good))[odd == "missing" :]:
        (cases / name).write_text(json.dumps(changed(good, keys, ODD[odd])))
        try:
            record = blind_score(cases, executor="serial")
            shown = to_json(record.to_dict()) + "".join(sentences(record))
        except GaitoptError as error:
            refused, shown = refused + 1, str(error)
        assert shown.replace("\n", "").isprintable()
        assert "nan" not in shown.lower() or odd == "NaN"
        assert len(shown) < 10_000 or odd == "a long text"
    assert refused > 0


@pytest.mark.parametrize(
    ("name", "keys", "new", "said"),
    [
        ("a", ("effects", 0, "parameters"), {}, "effects.servo_gain.parameters.scale: missing"),
        ("a", ("gap", "shrinkage"), -1e308, "gap.shrinkage: found -1e+308; allowed: greater than or equal"),
        ("a", ("effects", 0, "probability"), 1.1, "probability: found 1.1; allowed: less than or equal to"),
        ("t", ("kind",), "singel", "kind: found 'singel'; allowed: single, none, outside, pair"),
        ("t", ("effects",), [], "found no effect in a case of the kind single"),
        ("t", ("kind",), "none", "found an effect in a case of the kind none"),
        ("t", ("effects", 0, "parameters"), {}, "parameters: found {}; allowed:"),
        ("t", ("gap_over_floor",), math.nan, "gap_over_floor: found nan; allowed: a finite number"),
    ],
)
def test_an_impossible_case_is_one_line(
    name: str, keys: Keys, new: Any, said: str, cases: Path, capsys: Any
) -> None:
    path, good = (
        (cases / "diagnoses" / "case-000" / "diagnosis.json", ANSWER)
        if name == "a"
        else (cases / "sealed" / "case-000.json", TRUTH)
    )
    path.write_text(json.dumps(changed(good, keys, new)))
    code, err = run(capsys, "blind", "score", cases)
    assert (code, said in err) == (1, True), err


def test_a_certain_cause_is_in_the_calibration(cases: Path) -> None:
    """A sum of probabilities may be above 1 by its rounding."""
    path = cases / "diagnoses" / "case-000" / "diagnosis.json"
    path.write_text(json.dumps(changed(ANSWER, ("effects", 0, "probability"), math.nextafter(1.0, 2.0))))
    assert sum(row.right.cases for row in blind_score(cases).calibration) == 3


@pytest.mark.parametrize(
    "name",
    [
        *("diagnoses", "diagnoses/case-000", "diagnoses/case-000/diagnosis.json", "diagnoses/case-001/.lock"),
        *("sealed", "sealed/case-000.json", "nominal", "nominal/model.xml", "case-000", ".lock"),
    ],
)
@pytest.mark.parametrize("command", ["make", "score", "score elsewhere"])
def test_a_link_among_blind_cases_is_refused(
    command: str, name: str, cases: Path, tmp_path: Path, capsys: Any
) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    for mine in ("model.xml", "diagnosis.json", ".notes.abcd1234.txt"):
        (victim / mine).write_text("mine")
    path = cases / name
    if path.exists():
        path.rename(tmp_path / "moved")
    path.symlink_to(victim / "model.xml" if "." in path.name else victim)
    words: tuple[object, ...] = ("blind", "score", cases)
    if command == "make":
        words = (*MAKE, "--out", cases)
    elif command == "score elsewhere":
        diagnoses = cases / "diagnoses"
        words = (*words, "--diagnoses", tmp_path / "elsewhere")
        if path != diagnoses:  # else the user names the link
            diagnoses.rename(tmp_path / "elsewhere")
    code, err = run(capsys, *words)
    assert (code, "found a link; allowed in this folder: plain files" in err) == (1, True), err
    assert {file.name: file.read_text() for file in victim.iterdir()} == dict.fromkeys(
        ("model.xml", "diagnosis.json", ".notes.abcd1234.txt"), "mine"
    )


def test_cases_are_made_in_a_folder_of_such_cases_alone(cases: Path, tmp_path: Path, capsys: Any) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / ".notes.abcd1234.txt").write_text("mine")
    code, err = run(capsys, *MAKE, "--out", other)
    assert (code, "is not empty; allowed: a new or an empty folder" in err) == (1, True)
    assert [path.name for path in other.iterdir()] == [".notes.abcd1234.txt"]
    before = (cases / "nominal" / "problem.toml").read_text()
    (cases / "nominal" / "problem.toml").write_text(before + "# of another problem\n")
    code, err = run(capsys, *MAKE, "--out", cases)
    assert (code, "problem.toml is of another problem; allowed: a new folder" in err) == (1, True)
    assert (cases / "nominal" / "problem.toml").read_text() != before


def test_blind_cases_and_diagnoses_that_are_there_are_kept(cases: Path, capsys: Any) -> None:
    before = {path: path.stat().st_mtime_ns for path in cases.rglob("*.[jc]s*")}
    assert run(capsys, *MAKE, "--cases", 3, "--out", cases) == (0, "")
    assert run(capsys, "blind", "score", cases) == (0, "")
    assert {path: path.stat().st_mtime_ns for path in cases.rglob("*.[jc]s*")} == before
    assert len(before) == 6


def test_two_makers_of_cases_cannot_share_a_folder(cases: Path, tmp_path: Path, capsys: Any) -> None:
    (cases / "sealed" / ".case-003.abcd1234.json").write_text("half")
    with held(cases):
        code, err = run(capsys, *MAKE, "--out", cases)
    assert (code, "another run is working in this folder" in err) == (1, True)
    assert run(capsys, *MAKE, "--out", cases) == (0, "")
    assert not (cases / "sealed" / ".case-003.abcd1234.json").exists()
    assert run(capsys, *MAKE, "--gaits", "trot", "--out", tmp_path / "new")[0] == 1
    assert not (tmp_path / "new").exists()
