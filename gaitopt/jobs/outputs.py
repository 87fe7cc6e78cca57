"""Output folders and files of jobs, and the way Ctrl-C and SIGTERM leave them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from gaitopt.core.files import check_replaceable, noting_reads
from gaitopt.problem.problem import Problem

NUMBERED: Literal["results/runs/*"] = "results/runs/*"
"""As `out`: a new numbered folder under ``results/runs``, the default of the command line."""

Out = Path | str | None
"""Where a job writes: a new or an empty folder, `NUMBERED`, or None to write nothing."""


class Stopped(KeyboardInterrupt):
    """Ctrl-C or SIGTERM ended a job that can be resumed.

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


@contextmanager
def writing(problem: Problem, *outputs: Path | str | None) -> Iterator[None]:
    """Check the files that a job is to write, before anything is computed for them.

    A file that is there already is replaced only if it is plain and may be written, and only if the job has
    not read it: neither the problem's files nor what is read meanwhile. Its mode is kept; see `core.files`.

    Args:
        problem: the problem that the job works on.
        outputs: the files to write; None for those that are not wanted.

    Raises:
        GaitoptError: a file is not to be replaced.
    """
    named = [problem.model_path.parent / name for name in problem.carried or ()]
    with noting_reads(problem.source, problem.model_path, *named):
        for output in outputs:
            if output is not None:
                check_replaceable(Path(output))
        yield
