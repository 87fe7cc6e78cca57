"""Every line of docs/guarantees.md names tests, and these exist."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "guarantees.md").read_text()


def test_every_promise_names_tests_that_exist() -> None:
    known = {
        node.name
        for path in (ROOT / "tests").rglob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef)
    }
    promises = re.findall(r"^- (.*?)(?=\n- |\n\n|\Z)", PAGE, flags=re.M | re.S)
    assert len(promises) > 20
    for promise in promises:
        named = re.findall(r"`(test_\w+)`", promise)
        assert named or "pip-audit" in promise, promise
        assert not set(named) - known, set(named) - known


def test_the_figures_are_the_codes() -> None:
    from gaitopt.problem import start
    from gaitopt.simulation.rollout import RolloutSettings

    assert RolloutSettings().max_steps == 5_000_000
    assert start.SETTLE_LIMIT_STEPS == 1_000_000
    assert "five million steps a rollout, a million to come to rest" in " ".join(PAGE.split())
