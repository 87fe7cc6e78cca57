"""The structure of the code: imports point one way, files are short, the picture agrees with the code."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import house
import pytest
from importlinter import cli

LONGEST = 400
"""Lines of a file, unless its docstring says ``Longer than 400 lines because …``."""


def sources(*folders: str) -> list[Path]:
    """Every Python file in some folders of the repository."""
    found = [path for folder in folders for path in (house.ROOT / folder).rglob("*.py")]
    return [path for path in found if "node_modules" not in path.parts]


def test_imports_point_one_way(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(house.ROOT)
    failed = cli.lint_imports(no_cache=True, no_logo=True)
    assert not failed, capsys.readouterr().out


def test_every_package_has_a_row() -> None:
    packages = {path.parent.name for path in house.PACKAGE.glob("*/__init__.py")}
    assert packages == set(house.rows())


def test_the_picture_is_the_codes() -> None:
    assert house.PICTURE.read_text() == house.picture(), "draw it anew: python tests/house.py"


@pytest.mark.parametrize("folder", ["gaitopt", "tests"])
def test_no_file_is_long_without_a_reason(folder: str) -> None:
    long = {}
    for path in sources(folder):
        text = path.read_text()
        reason = f"Longer than {LONGEST} lines because" in (ast.get_docstring(ast.parse(text)) or "")
        if text.count("\n") > LONGEST and not reason:
            long[str(path.relative_to(house.ROOT))] = text.count("\n")
    assert not long


def test_the_root_of_the_package_holds_little() -> None:
    assert len([path for path in house.PACKAGE.iterdir() if path.is_file()]) <= 5


def records(tree: ast.Module) -> Iterator[ast.ClassDef]:
    """Every dataclass, named tuple and Pydantic model of a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            made = [ast.unparse(part) for part in [*node.decorator_list, *node.bases]]
            if any(word in text for text in made for word in ("dataclass", "NamedTuple", "BaseModel")):
                yield node


def test_no_record_has_a_field_of_any_type() -> None:
    loose = [
        f"{path.relative_to(house.ROOT)}: {record.name}.{ast.unparse(field.target)}"
        for path in sources("gaitopt")
        for record in records(ast.parse(path.read_text()))
        for field in record.body
        if isinstance(field, ast.AnnAssign)
        and "Any" in {node.id for node in ast.walk(field.annotation) if isinstance(node, ast.Name)}
    ]
    assert not loose
