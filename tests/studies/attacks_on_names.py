"""Attacks with names and numbers (findings 4 and 9 of issue 28)."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

from attacked import (
    ATTACKS,
    DONE,
    SEARCH,
    STRIDER,
    Attack,
    Ended,
    Ground,
    attack,
    edited_json,
    resumed,
)

# Finding 4: names that act.


def named(on: Ground, name: str) -> Path:
    text = json.dumps(name)
    return on.robot(
        ("problem.toml", "[baselines.stride]", f"[baselines.{text}]"),
        ("problem.toml", "[baselines.stride.channels]", f"[baselines.{text}.channels]"),
    )


def printed(ended: Ended, name: str) -> Ended:
    """Say so where a name is not printed as it is."""
    if ended.code == 0 and not ended.more and name not in ended.out:
        return replace(ended, more="the name was obeyed, not printed")
    return ended


@attack(4, "`compare` with a gait called `[/x]`", DONE)
def compared(on: Ground) -> Ended:
    return printed(on.run("compare", named(on, "[/x]"), "[/x]", "square"), "[/x]")


for _name in ("[/x]", "[bold red]b", "[link=file:///a]b[/link]"):

    def simulated(on: Ground, name: str = _name) -> Ended:
        return printed(on.run("simulate", named(on, name), name), name)

    ATTACKS.append(Attack(4, f"`simulate` of a gait called `{_name}`", simulated, DONE))


def searched(on: Ground, name: str) -> Ended:
    """Search, and look whether the result is there, or comes with a resume."""
    ended = on.run("optimise", named(on, name), *SEARCH, "--out", "run")
    lost = ended.code != 0 and on.run("optimise", "run", "--resume", "run", "--quiet").code != 0
    missing = [file for file in ("best.toml", "summary.json") if not (on.folder / "run" / file).exists()]
    if missing:
        return replace(ended, more=f"{ended.outcome}; {' and '.join(missing)} lost, on resume too")
    return replace(ended, more=f"{ended.outcome}; every resume fails again") if lost else ended


for _name in ("[/x]", "$\\frac{$"):
    ATTACKS.append(Attack(4, f"`optimise` with a gait called `{_name}`", partial(searched, name=_name), DONE))


@attack(4, "escape sequences in an edited `summary.json`", DONE)
def escapes_in_a_summary(on: Ground) -> Ended:
    run = on.finished()
    edited_json(run / "summary.json", lambda c: c["baselines"][0].update(name="\x1b[31mred\u202e"))
    edited_json(
        run / "summary.json", lambda c: c["best"].update(name="\x1b[31mred\u202e", found_by="\x1b[2J")
    )
    return resumed(on, run)


@attack(4, "escape sequences in an edited `diagnosis.json`", DONE)
def escapes_in_a_diagnosis(on: Ground) -> Ended:
    folder = on.folder / "diagnosis"
    folder.mkdir()
    content = {"answer": "No gap.\x1b[2J\u202e", "explanation": ["\x1b]0;owned\x07"]}
    (folder / "diagnosis.json").write_text(json.dumps(content))
    (folder / "report.html").touch()
    return on.run("diagnose", STRIDER, on.dataset(), "--resume", folder)


# Finding 9: names and numbers of tables, and names of pads.


@attack(9, "a gait file with a channel named like the mark of a table", DONE)
def marked_channel(on: Ground) -> Ended:
    mark = json.dumps("gaitopt-table: {")
    robot = on.robot(
        ("strider.xml", '<position name="rear"', "<position name='gaitopt-table: {'"),
        ("problem.toml", "[channels.rear]", f"[channels.{mark}]"),
        ("problem.toml", "\nrear = {", f"\n{mark} = {{"),
    )
    wave = "{ duty = 0.5, phase = 0.0, amplitude_deg = 40.0, offset_deg = -20.0, smoothing = 0.8 }"
    gait = on.folder / "gait.toml"
    gait.write_text(f"period_s = 0.5\n[channels]\n{mark} = {wave}\nfront = {wave}\n")
    return on.run("simulate", robot, gait)


NUMBERS = {"1_000": "0.0_11", "digits of another script": "\u0660.\u0660\u0661\u0661"}
for _title, _cell in NUMBERS.items():

    def odd_number(on: Ground, odd: str = _cell) -> Ended:
        ended = on.run("import", on.recording(odd), "--gait", "square-1s", "--out", "out")
        return replace(ended, more="read as a number") if ended.code == 0 else ended

    ATTACKS.append(Attack(9, f"{_title} in a recording", odd_number))


@attack(9, "`new` for a robot with the pad `rear's foot`", DONE)
def apostrophe(on: Ground) -> Ended:
    robot = on.robot(("strider.xml", 'name="rear_foot"', 'name="rear\'s foot"'))
    ended = on.run("new", "bot", "--mjcf", robot / "strider.xml", "--out", "bot")
    return on.run("simulate", "bot", "first-guess") if ended.code == 0 else ended
