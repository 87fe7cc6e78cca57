"""Output folders of jobs, and the way Ctrl-C leaves them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

NUMBERED: Literal["results/runs/*"] = "results/runs/*"
"""As `out`: a new numbered folder under ``results/runs``, the default of the command line."""

Out = Path | str | None
"""Where a job writes: a new or an empty folder, `NUMBERED`, or None to write nothing."""


class Stopped(KeyboardInterrupt):
    """Ctrl-C ended a job that can be resumed.

    Attributes:
        done: what was done until then, in words.
        folder: the folder to resume it in.
    """

    def __init__(self, done: str, folder: Path):
        super().__init__(f"stopped after {done}; go on with resume={str(folder)!r}")
        self.done = done
        self.folder = folder


def out_folder(out: Out) -> Path | None:
    """Return the folder that a job is to write; None for a numbered one."""
    return None if out is None or out == NUMBERED else Path(out)
