"""Edited files of a run folder, for tests and studies of any version: nothing here needs gaitopt."""

import shutil
from pathlib import Path
from typing import Any


def deep(levels: int) -> Any:
    """A list in a list in a list, so many levels deep."""
    value: Any = 1
    for _ in range(levels):
        value = [value]
    return value


def as_if_killed(run: Path) -> Path:
    """Make a finished run as if it had been killed after three gaits; return it."""
    for name in ("best.toml", "summary.json", "report.html"):
        (run / name).unlink()
    shutil.rmtree(run / "figures")
    journal = run / "evaluations.csv"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:4]))
    return run
