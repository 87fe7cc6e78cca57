"""Few effects on an exactly made robot, or any number on one that is a little wrong: which way is taken."""

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import pytest

from gaitopt.diagnose.judge.settings import DEFAULT

find_causes = import_module("gaitopt.diagnose.judge.find_causes")
LIMIT = DEFAULT.verdict.uneven


@pytest.mark.parametrize(
    ("exact", "uneven", "way"),
    [("exact", 0.5 * LIMIT, "exact"), ("exact", 2.0 * LIMIT, "tolerant"), (None, 0.0, "tolerant")],
)
def test_an_exact_robot_is_the_answer_only_where_cycles_are_even(
    monkeypatch: pytest.MonkeyPatch, exact: str | None, uneven: float, way: str
) -> None:
    search = SimpleNamespace(
        exactly=lambda: (exact, "sets") if exact else None, with_tolerances=lambda: ("tolerant", "sets")
    )
    monkeypatch.setattr(find_causes, "GaitSets", lambda *_: search)
    monkeypatch.setattr(
        find_causes, "_concluded_sets", lambda name, *_: SimpleNamespace(name=name, unevenness=uneven)
    )
    gap, context = SimpleNamespace(floors=()), SimpleNamespace(settings=DEFAULT)
    found: Any = find_causes._explained_by_gait_sets(None, None, gap, (), context)
    assert found.name == way
