"""Running commands in tests: what they print, and how they refuse."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from helpers import edited

from gaitopt.gait.gait import write_gait
from gaitopt.problem.problem import Problem

Run = Callable[..., tuple[int, str, str]]
"""Runs a command; returns its exit code, standard output and standard error."""

RUN_FILES = {
    *("best.toml", "summary.json", "evaluations.csv", "problem.toml", "model.xml", "report.html"),
    *("figures", "run.toml"),
}


def strictly(text: str) -> Any:
    """Parse JSON that knows neither NaN nor infinity."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def without_clock(folder: Path) -> dict[str, Any]:
    """A run's summary without the one figure that comes from a clock."""
    content = strictly((folder / "summary.json").read_text())
    assert content.pop("wall_s") > 0.0
    return content


def refused(gaitopt: Run, *arguments: object) -> str:
    """The one line that a command ends with; no half-written file is left here or in the folder above."""
    before = {path for path in Path().resolve().parent.rglob("*") if "finished" not in path.parts}
    code, out, err = gaitopt(*arguments)
    assert code == 1
    assert out == ""
    assert err.startswith("gaitopt: ")
    assert err.count("\n") == 1, err
    after = {path for path in Path().resolve().parent.rglob("*") if "finished" not in path.parts}
    assert after == before
    return err.removeprefix("gaitopt: ").rstrip("\n")


def gait_file(strider: Problem, old: str, new: str) -> Path:
    """A gait file of the strider with a mistake."""
    write_gait(Path("gait.toml"), strider.baselines["square"])
    return edited(Path("gait.toml"), old, new)
