"""Every line of docs/guarantees.md names tests that are run here, or says what keeps them from it."""

import ast
import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "guarantees.md").read_text()
BY_HAND = "pip-audit"
"""What one line tells to do by hand; every other line names a test."""


Row = dict[str, Any]
"""A test that pytest collects: its name, its file, and what keeps it from running here."""


@pytest.fixture(scope="module")
def collected() -> dict[str, list[Row]]:
    """The tests of the whole repository by the names of their functions."""
    done = subprocess.run(
        [sys.executable, ROOT / "tests" / "collecting.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, list[Row]] = {}
    for row in json.loads(done.stdout):
        found.setdefault(row["name"], []).append(row)
    return found


@cache
def promises() -> list[tuple[str, list[str]]]:
    """Each line of the page with the tests that it names."""
    lines = re.findall(r"^- (.*?)(?=\n- |\n\n|\Z)", PAGE, flags=re.M | re.S)
    return [(line, re.findall(r"`(test_\w+)`", line)) for line in lines]


NAMED = sorted({name for _, named in promises() for name in named})


def test_every_promise_names_a_test() -> None:
    assert len(promises()) > 20
    for line, named in promises():
        assert named or BY_HAND in line, line
    assert sum(not named for _, named in promises()) <= 1
    assert set(re.findall(r"\btest_\w+", PAGE)) == set(NAMED), "a test is named outside of a line"


@pytest.mark.slow
def test_every_test_that_is_named_runs_here(collected: dict[str, list[Row]]) -> None:
    """One that is skipped for what holds on this machine, in all of its cases, shows nothing here."""
    assert len(collected) > 800
    for name in NAMED:
        assert name in collected, f"{name} is no test"
        assert not all(row["obstacles"] for row in collected[name]), collected[name]


@pytest.mark.slow
def test_every_test_that_is_named_asserts_something(collected: dict[str, list[Row]]) -> None:
    """A test without an assertion, an expected error or a helper that has one would pass whatever happens."""
    for name in NAMED:
        source = Path(collected[name][0]["file"]).read_text()
        (function,) = (
            node
            for node in ast.walk(ast.parse(source))
            if isinstance(node, ast.FunctionDef) and node.name == name
        )
        body = ast.unparse(function)
        assert re.search(
            r"\bassert\b|raises\(|refused\(|complaint\(|check=True|(check|assert)_\w+\(", body
        ), name


def test_the_figures_are_the_codes() -> None:
    from gaitopt.problem import start
    from gaitopt.simulation.rollout import RolloutSettings

    assert RolloutSettings().max_steps == 5_000_000
    assert start.SETTLE_LIMIT_STEPS == 1_000_000
    assert "five million steps a rollout, a million to come to rest" in " ".join(PAGE.split())
