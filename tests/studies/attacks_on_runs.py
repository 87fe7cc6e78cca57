"""Attacks with run folders: links out of them, and edited files (findings 1 and 5 of issue 28)."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from attacked import (
    ATTACKS,
    CASE,
    DONE,
    ONE_LINE,
    SEARCH,
    STRIDER,
    Attack,
    Ended,
    Ground,
    attack,
    edited_json,
    resumed,
)
from edited_runs import deep

# Finding 1: a stranger's run folder destroys files outside of it.


@attack(1, "`.lock` of a finished run links to a file")
def linked_lock(on: Ground) -> Ended:
    run = on.finished()
    (run / ".lock").symlink_to(on.victims / "notes.txt")
    return resumed(on, run)


@attack(1, "`.lock` is a second name of a file")
def second_name(on: Ground) -> Ended:
    run = on.finished()
    (run / ".lock").hardlink_to(on.victims / "notes.txt")
    return resumed(on, run)


@attack(1, "`evaluations.csv` of an unfinished run links to a file")
def linked_journal(on: Ground) -> Ended:
    run = on.unfinished()
    on.add_victim("evaluations.csv", (run / "evaluations.csv").read_text())
    (run / "evaluations.csv").unlink()
    (run / "evaluations.csv").symlink_to(on.victims / "evaluations.csv")
    return resumed(on, run)


@attack(1, "`pareto` links to a folder")
def linked_folder(on: Ground) -> Ended:
    run = on.unfinished()
    (run / "pareto").symlink_to(on.victims)
    return resumed(on, run)


@attack(1, "`.lock` of a diagnosis links to a file")
def linked_diagnosis(on: Ground) -> Ended:
    (on.folder / "diagnosis").mkdir()
    (on.folder / "diagnosis" / ".lock").symlink_to(on.victims / "notes.txt")
    return on.run("diagnose", STRIDER, on.dataset(), "--resume", "diagnosis", "--quiet")


@attack(1, "`diagnoses/case-000` of blind cases links to a folder")
def linked_case(on: Ground) -> Ended:
    cases = on.cases()
    (cases / "diagnoses").mkdir()
    (cases / "diagnoses" / "case-000").symlink_to(on.victims)
    return on.run("blind", "score", cases)


@attack(1, "`nominal` of blind cases links to a folder")
def linked_nominal(on: Ground) -> Ended:
    (on.folder / "cases").mkdir()
    (on.folder / "cases" / "nominal").symlink_to(on.victims)
    return on.run("blind", "make", STRIDER, *CASE, "--out", "cases")


@attack(1, "`blind make` with a gait called `../../victims/table`")
def gait_elsewhere(on: Ground) -> Ended:
    on.add_victim("table.csv", "mine")
    name = json.dumps("../../victims/table")
    robot = on.robot(
        ("problem.toml", "[baselines.stride]", f"[baselines.{name}]"),
        ("problem.toml", "[baselines.stride.channels]", f"[baselines.{name}.channels]"),
    )
    return on.run("blind", "make", robot, *CASE, "--gaits", "../../victims/table", "--out", "cases")


@attack(1, "`blind score --diagnoses D` with a case called as a folder of the user in `D`")
def case_of_the_user(on: Ground) -> Ended:
    cases = on.cases()
    shutil.copytree(on.victims, on.folder / "mine" / "case-000")
    before = sorted((on.folder / "mine" / "case-000").iterdir())
    ended = on.run("blind", "score", cases, "--diagnoses", "mine")
    same = before == sorted((on.folder / "mine" / "case-000").iterdir())
    return ended if same else replace(ended, more="**destroyed** files of the user")


@attack(1, "a model names the file `model.xml`, which a run writes itself")
def taken_name(on: Ground) -> Ended:
    robot = on.robot(
        ("problem.toml", 'name = "strider"', 'name = "strider"\nmodel = "strider.xml"'),
        ("strider.xml", "</worldbody>", '</worldbody><asset><model name="n" file="model.xml"/></asset>'),
    )
    (robot / "model.xml").write_text("<mujoco><worldbody><body name='b'/></worldbody></mujoco>")
    ended = on.run("optimise", robot, *SEARCH, "--out", "run")
    if ended.code == 0 and on.run("simulate", "run", "stride").code != 0:
        return replace(ended, more="the run is no problem and cannot be resumed")
    return ended


# Finding 5: edited run folders.


SUMMARIES: dict[str, tuple[Callable[[Any], object], str]] = {
    "a null interval": (lambda c: c["best"].update(speed_ci90_m_s=None), ""),
    "null ends of the interval": (lambda c: c["best"].update(speed_ci90_m_s=[None, None]), ""),
    "no baselines": (lambda c: c.update(baselines=[]), ""),
    "no best gait": (lambda c: c.update(best=None), ONE_LINE),
    "a speed of 4,000 digits": (lambda c: c["best"].update(speed_m_s=10**4000), ONE_LINE),
    "900 levels": (lambda c: c.update(extra=deep(900)), ""),
}
for _title, (_change, _right) in SUMMARIES.items():

    def edited_summary(on: Ground, change: Callable[[Any], object] = _change) -> Ended:
        run = on.finished()
        edited_json(run / "summary.json", change)
        return resumed(on, run)

    ATTACKS.append(
        Attack(5, f"`summary.json` with {_title}", edited_summary, _right or f"{DONE} or {ONE_LINE}")
    )

REQUESTS = {
    "seed -1": ("seed = 5", "seed = -1"),
    "a budget of 0": ("budget = 6", "budget = 0"),
    "a budget of 4,000 digits": ("budget = 6", f"budget = {'9' * 4000}"),
    "300 levels": ("seed = 5", f"seed = {'[' * 300}{']' * 300}"),
}
for _title, (_old, _new) in REQUESTS.items():

    def edited_request(on: Ground, old: str = _old, new: str = _new) -> Ended:
        run = on.unfinished()
        text = (run / "run.toml").read_text()
        assert old in text
        (run / "run.toml").write_text(text.replace(old, new))
        return resumed(on, run)

    ATTACKS.append(Attack(5, f"`run.toml` with {_title}", edited_request))


def cell(name: str, value: str) -> Callable[[list[str]], object]:
    def change(rows: list[str]) -> None:
        cells = rows[2].split(",")
        cells[rows[0].split(",").index(name)] = value
        rows[2] = ",".join(cells)

    return change


JOURNALS: dict[str, Callable[[list[str]], object]] = {
    "a cost that is no number": cell("cost", "nan"),
    "another speed": cell("speed_m_s", "9.9"),
    "an unknown rung": cell("rung", "cellar"),
    "a number of 4,000 digits": cell("evaluation", "9" * 4000),
    "a cell of 200,000 characters": cell("status", "x" * 200_000),
    "a row twice": lambda rows: rows.insert(2, rows[2]),
}
for _title, _edit in JOURNALS.items():

    def edited_journal(on: Ground, edit: Callable[[list[str]], object] = _edit) -> Ended:
        run = on.unfinished()
        rows = (run / "evaluations.csv").read_text().splitlines()
        edit(rows)
        (run / "evaluations.csv").write_text("\n".join(rows) + "\n")
        ended = resumed(on, run)
        return replace(ended, more="believed") if ended.code == 0 else ended

    ATTACKS.append(Attack(5, f"`evaluations.csv` with {_title}", edited_journal))


@attack(5, "`evaluations.csv` with more rows than the budget")
def more_rows(on: Ground) -> Ended:
    run = on.finished()
    for name in ("best.toml", "summary.json", "report.html"):
        (run / name).unlink()
    text = (run / "run.toml").read_text()
    (run / "run.toml").write_text(text.replace("budget = 6", "budget = 2"))
    ended = resumed(on, run)
    return replace(ended, more="believed") if ended.code == 0 else ended


def scored(on: Ground, change: Callable[[Any], object], of_truth: bool = False) -> Ended:
    """Score a case whose diagnosis or whose truth was edited."""
    cases, parameters = on.cases(), {"scale": {"value": 0.5, "ci90": [0.4, 0.6]}}
    effect = {"name": "servo_gain", "target": "all", "probability": 0.9, "parameters": parameters}
    answer = {
        "verdict": "explained",
        "causes": ["servo_gain"],
        "ambiguous_with": [],
        "effects": [effect | {"heldout_shrinkage": 0.9, "alike": 1.0}],
        "other_probability": 0.01,
        "gap": {"shrinkage": 0.9},
    }
    planted = {"name": "servo_gain", "target": "all", "parameters": {"scale": 0.5}}
    truth = {"kind": "single", "effects": [planted], "gap_over_floor": 10.0, "figures": {}}
    change(truth if of_truth else answer)
    folder = cases / "diagnoses" / "case-000"
    folder.mkdir(parents=True)
    (folder / "report.html").touch()
    (folder / "diagnosis.json").write_text(json.dumps(answer))
    (cases / "sealed" / "case-000.json").write_text(json.dumps(truth))
    return on.run("blind", "score", cases)


@attack(0, "`blind score` of a diagnosed case", DONE)
def honest_score(on: Ground) -> Ended:
    return scored(on, lambda answer: None)


@attack(5, "`blind score` of a `diagnosis.json` without the parameter")
def no_parameter(on: Ground) -> Ended:
    return scored(on, lambda answer: answer["effects"][0].update(parameters={}))


@attack(5, "`blind score` of a truth without effects")
def no_effect(on: Ground) -> Ended:
    return scored(on, lambda truth: truth.update(effects=[]), of_truth=True)


@attack(5, "`blind score` of a truth whose parameter is no number")
def no_number(on: Ground) -> Ended:
    nan = {"parameters": {"scale": math.nan}}
    ended = scored(on, lambda truth: truth["effects"][0].update(nan), of_truth=True)
    return replace(ended, more="believed") if ended.code == 0 else ended


@attack(5, "`diagnosis.json` with 900 levels, printed by `diagnose --resume --json`")
def deep_diagnosis(on: Ground) -> Ended:
    folder = on.folder / "diagnosis"
    folder.mkdir()
    content = {"answer": "No gap.", "explanation": ["All within the floor."], "extra": deep(900)}
    (folder / "diagnosis.json").write_text(json.dumps(content))
    (folder / "report.html").touch()
    return on.run("diagnose", STRIDER, on.dataset(), "--resume", folder, "--json")
