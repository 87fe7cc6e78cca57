"""Problem files that say how they differ from another one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import inside, read_toml
from gaitopt.problem.lookup import PROBLEM_FILE, bundled_names, bundled_problems

_KEY = "like"

_NOT_HELD = ("objective", "planar")
"""What a robot that is held cannot do: it does not go anywhere."""


def like_another(content: Mapping[str, Any], path: Path) -> tuple[dict[str, Any], Path]:
    """Return the content of a problem file with what it takes from another one, and the file of the MJCF.

    ``like = "NAME"`` names a bundled problem, or a problem file in the same folder. All its keys count where
    this file has none; tables are joined. The MJCF is that of the other problem too, unless this file names
    one. A robot that is held gets no aim and no plan from another problem.

    Args:
        content: the content of the file.
        path: the file.

    Returns:
        The whole content, without ``like``, and the problem file beside which the MJCF lies.

    Raises:
        GaitoptError: there is no such problem, or it is like another one itself.
    """
    own = {key: value for key, value in content.items() if key != _KEY}
    if _KEY not in content:
        return own, path
    other = _other_file(content[_KEY], path)
    base = read_toml(other)
    if _KEY in base:
        raise GaitoptError(
            f"{path}: {_KEY}: {other} is itself like another problem; allowed: one that is not"
        )
    start = own.get("start")
    if isinstance(start, dict) and start.get("held"):
        base = {key: value for key, value in base.items() if key not in _NOT_HELD}
    return _joined(base, own), path if "model" in own else other


def _other_file(name: object, path: Path) -> Path:
    bundled = bundled_names()
    if isinstance(name, str) and name in bundled:
        return bundled_problems() / name / PROBLEM_FILE
    beside = inside(path.parent, name) if isinstance(name, str) and name else None
    if beside is None or not beside.is_file():
        allowed = f"a problem file in the same folder, or one of {', '.join(bundled)}"
        raise bad_value(path, _KEY, name, allowed, bundled)
    return beside


def _joined(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of two files as one; where both have a value, the second's counts."""
    joined = dict(base)
    for key, value in own.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        joined[key] = _joined(base[key], value) if both else value
    return joined
