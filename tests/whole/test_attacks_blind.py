"""Attacks with a folder of blind cases that a stranger sent: edited answers and truths, and links."""

import json
import math
import os
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from edited_runs import deep
from helpers import STRIDER, problem_folder
from hostility import contents, run, within

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


ENTRIES = [
    *(".lock", "nominal", "nominal/model.xml", "nominal/problem.toml", "nominal/assets", "sealed"),
    *("nominal/.model.abcd1234.xml", "sealed/case-000.json", "sealed/.case-000.abcd1234.json", "case-000"),
    *("case-000/dataset.toml", "case-000/stride.csv", "case-003", "sealed/case-003.json", "diagnoses"),
    *("diagnoses/case-003", ".notes.abcd1234.txt"),
]
"""What `blind make` and `blind score` read, write or sweep up; some of it is not there yet."""

OF_A_DIAGNOSIS = [
    *("", "diagnosis.json", ".lock", "report.html", "model.xml", "corrected.toml", "next.toml", "figures"),
    *(
        "figures/ranking.png",
        "simulated-0123456789abcdef",
        ".report.abcd1234.html",
        "next-player",
        "next.csv",
        "posterior.csv",
    ),
]


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A folder of the user, with files that these commands write, and one that a sweep would remove."""
    folder = tmp_path / "victim"
    folder.mkdir()
    for name in ("model.xml", "diagnosis.json", ".notes.abcd1234.txt"):
        (folder / name).write_text("mine")
    return folder


def planted(path: Path, kind: str, victim: Path) -> None:
    """Put a link, a second name or a pipe in the place of a file or a folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists():
        path.rename(victim.parent / "moved")
    if kind == "link":
        path.symlink_to(victim / "model.xml" if path.suffix else victim)
    elif kind == "dangling link":
        path.symlink_to(victim / "new" / "file")
    elif kind == "link to itself":
        path.symlink_to(path)
    elif kind == "hard link":
        path.hardlink_to(victim / "model.xml")
    else:
        os.mkfifo(path)


@pytest.mark.parametrize(
    "name", [*ENTRIES, *(f"diagnoses/case-00{i % 3}/{name}" for i, name in enumerate(OF_A_DIAGNOSIS))]
)
@pytest.mark.parametrize("kind", ["link", "dangling link", "link to itself", "hard link", "pipe"])
@pytest.mark.parametrize("command", ["make", "score", "score elsewhere"])
def test_a_link_among_blind_cases_is_refused(
    command: str, kind: str, name: str, cases: Path, victim: Path, tmp_path: Path, capsys: Any
) -> None:
    """Nothing is waited for, and nothing changes: neither what a link leads to, nor the cases."""
    planted(cases / name, kind, victim)
    words: tuple[object, ...] = ("blind", "score", cases)
    if command == "make":
        words = (*MAKE, "--cases", 4, "--out", cases)
    elif command == "score elsewhere":
        words = (*words, "--diagnoses", tmp_path / "elsewhere")
        if name != "diagnoses":  # else the user names the link
            (cases / "diagnoses").rename(tmp_path / "elsewhere")
    before = listed(cases), contents(victim)
    with within(20):
        code, err = run(capsys, *words)
    assert (code, "allowed in this folder: plain files with one name" in err) == (1, True), err
    assert (listed(cases), contents(victim)) == before


def listed(folder: Path) -> dict[Path, tuple[int, int, int]]:
    """Inode, size and time stamp of everything in a folder; links are not followed."""
    found = {path: path.lstat() for path in folder.rglob("*")}
    return {path: (one.st_ino, one.st_size, one.st_mtime_ns) for path, one in found.items()}


def recorded(case: Path) -> None:
    """Write a data set that can be diagnosed."""
    stamps = "".join(f"{0.05 * index:.2f},0.1\n" for index in range(60))
    (case / "walk.csv").write_text(f"t_s,y_m\n{stamps}")
    trial = '[[trial]]\nname = "one"\ngait = "stride"\nfile = "walk.csv"\n'
    (case / "dataset.toml").write_text(trial + 'signals = {"marker.y" = "y_m"}\n')


@pytest.mark.parametrize("name", ["model.xml", "notes.txt", "simulated-0123456789abcdef/x.npz"])
def test_a_case_is_not_diagnosed_into_a_folder_of_the_user(
    name: str, cases: Path, tmp_path: Path, capsys: Any
) -> None:
    """What a stranger called a case may be what the user called something else."""
    recorded(cases / "case-000")
    mine = tmp_path / "mine" / "case-000"
    (mine / name).parent.mkdir(parents=True)
    (mine / name).write_text("mine")
    before = listed(mine)
    code, err = run(capsys, "blind", "score", cases, "--diagnoses", mine.parent, "--json")
    assert (code, "allowed: an unfinished diagnosis of this case, or nothing" in err) == (1, True), err
    assert listed(mine) == before


@pytest.mark.parametrize("kind", ["dangling link", "link to itself", "pipe"])
@pytest.mark.parametrize("command", ["make", "score", "score elsewhere"])
def test_what_is_no_folder_of_cases_is_one_line(
    command: str, kind: str, cases: Path, victim: Path, tmp_path: Path, capsys: Any
) -> None:
    """The user names it: a link to a folder would be followed, but there is none."""
    planted(tmp_path / "odd", kind, victim)
    recorded(cases / "case-000")
    words: dict[str, tuple[object, ...]] = {
        "make": (*MAKE, "--out", tmp_path / "odd"),
        "score": ("blind", "score", tmp_path / "odd"),
        "score elsewhere": ("blind", "score", cases, "--diagnoses", tmp_path / "odd", "--json"),
    }
    before = listed(cases), contents(victim)
    with within(20):
        code, err = run(capsys, *words[command])
    assert (code, str(tmp_path / "odd") in err) == (1, True), err
    assert (listed(cases), contents(victim)) == before
    assert (tmp_path / "odd").lstat().st_mode == (tmp_path / "odd").lstat().st_mode


@pytest.mark.parametrize("name", ["../../victim/model", "{}/model", "..\\model", "sub/model", "n" * 300])
def test_the_name_of_a_gait_leads_to_no_other_file(
    name: str, victim: Path, tmp_path: Path, capsys: Any
) -> None:
    """Each gait has a file of its name in a case; the problem may be a stranger's."""
    name = name.format(victim)
    (victim / "model.csv").write_text("mine")

    def renamed(content: dict[str, Any]) -> None:
        content["baselines"] = {name: content["baselines"]["stride"]}

    robot, before = problem_folder(tmp_path / "robot", STRIDER, renamed), contents(victim)
    words = (
        *MAKE[3:5],
        "--kind",
        "none",
        "--seconds",
        3,
        "--signals",
        "marker.y",
        "--out",
        tmp_path / "cases",
    )
    code, err = run(capsys, "blind", "make", robot, *words)
    assert contents(victim) == before
    assert (code, "allowed: names of files" in err) == (1, True), err
    assert not (tmp_path / "cases").exists()


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
