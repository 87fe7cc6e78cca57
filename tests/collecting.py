"""The tests that pytest collects here, with what keeps each from running, as JSON on standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


class _Collected:
    """Notes the tests that pytest would run."""

    def __init__(self) -> None:
        self.items: list[pytest.Item] = []

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.items = session.items


def _obstacles(item: pytest.Item) -> Iterator[str]:
    """What keeps a test from running here by its marks."""
    for mark in item.iter_markers():
        if mark.name in ("skip", "xfail"):
            yield mark.name
        if mark.name == "skipif" and any(mark.args):
            yield f"skipped here: {mark.kwargs.get('reason')}"


def main() -> int:
    """Collect all tests and print name, file and obstacles of each."""
    plugin = _Collected()
    options = ["--collect-only", "-p", "no:cacheprovider", "-p", "no:terminal", "-n", "0", "-m", ""]
    code = pytest.main([*options, str(Path(__file__).parent)], plugins=[plugin])
    rows = [
        {
            "name": getattr(item, "originalname", item.name),
            "file": str(item.path),
            "obstacles": list(_obstacles(item)),
        }
        for item in plugin.items
    ]
    json.dump(rows, sys.stdout)
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
