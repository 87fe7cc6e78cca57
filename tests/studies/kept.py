"""Cases of a long study, kept line by line, so that it can continue on any machine."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gaitopt.core.files import write_text
from gaitopt.core.json import to_json


def read_kept(path: Path, seed: int | None = None) -> list[dict[str, Any]]:
    """Return the finished cases; refuse those of another seed if a study has only one."""
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    others = {row["seed"] for row in rows} - {seed}
    if seed is not None and others:
        raise SystemExit(
            f"{path}: cases of seed {others.pop()}, not {seed}: move them away or name another --out"
        )
    return rows


def write_kept(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write the finished cases, one per line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, "".join(to_json(row, None) for row in rows))


CODE = ("gaitopt", "problems", "tests", "pyproject.toml")
"""The code that a result depends on; results that are recorded meanwhile do not count."""


def version() -> str:
    """Return the code's commit, marked where the work tree's code differs from it."""
    commit = _git("describe", "--always", "--abbrev=12") or "unknown"
    return f"{commit}-dirty" if _git("status", "--porcelain", "--", *CODE) else commit


def _git(*words: str) -> str:
    root = Path(__file__).parents[2]
    return subprocess.run(
        ["git", *words], capture_output=True, text=True, check=False, cwd=root
    ).stdout.strip()
