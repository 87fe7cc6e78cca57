"""Folders that a command fills: new or empty, locked meanwhile, each file complete or absent."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_bytes, write_text, write_with
from gaitopt.core.folders import check_new_or_empty, not_empty
from gaitopt.core.interrupts import interrupts_held
from gaitopt.core.own_files import check_folder, make_own_folder
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.model import assets_beside
from gaitopt.problem.problem import Problem
from gaitopt.runs.lock import LOCK_FILE, FolderLock

RUNS = Path("results") / "runs"
"""Where run folders go by default; git ignores it."""

REQUEST_FILE = "run.toml"
"""The request of a run of `optimise`."""

JOURNAL_FILE = "evaluations.csv"
"""The evaluations of a run of `optimise`."""

MODEL_FILE = "model.xml"

PAGE_FILE = "report.html"
"""The page of any run; written after its results."""

FIRST_FILES = (PROBLEM_FILE, MODEL_FILE)
"""What a run writes in its first second, after the lock."""

POSTERIOR_FILE = "posterior.csv"
"""Robots of the posterior of a diagnosis; a run of `optimise` that used them has a copy."""

_HALF_WRITTEN = re.compile(r"\..+\.[a-z0-9_]{8}\.\w+")
"""Names of the temporary files that `files.write_with` renames into place; a killed run may leave one."""


@contextmanager
def filled_folder(path: Path | None, name: str) -> Iterator[Path]:
    """Yield a new or empty folder: `path`, or a numbered one under `RUNS`.

    One that was made and stays empty is removed.

    Raises:
        GaitoptError: the folder holds something already, or cannot be made.
    """
    path = path or next_free(name)
    made = False
    try:
        with interrupts_held():  # so that no folder is made that nobody removes
            made = make_folder(path)
        yield path
    finally:
        if made:
            with suppress(OSError):  # it holds something
                path.rmdir()


def next_free(name: str) -> Path:
    """Return the first numbered path of a name under `RUNS` that is not there yet."""
    number = 1
    while (RUNS / f"{name}-{number:03d}").exists():
        number += 1
    return RUNS / f"{name}-{number:03d}"


def make_folder(path: Path) -> bool:
    """Make a folder, or take an empty one; return whether it was made.

    Raises:
        GaitoptError: the folder holds something already, or cannot be made.
    """
    if path.is_dir():
        if (path / REQUEST_FILE).exists() or (path / JOURNAL_FILE).exists():
            raise GaitoptError(
                f"--out: {path} already holds a run; choose another folder, or --resume {path}"
            )
        if any(path.iterdir()) and not _killed_while_made(path):
            raise not_empty(path)
        check_folder(path)
        return False
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise GaitoptError(f"--out: {path}: cannot be made: {error.strerror}") from None
    return True


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Lock a folder for other runs, and remove what a killed run left half-written there.

    Raises:
        GaitoptError: another run is working there, or the folder cannot be written.
    """
    check_folder(path)
    lock = FolderLock(path)
    try:
        with interrupts_held():
            lock.take()
        remove_half_written(path)
        yield
    finally:
        lock.release()


def remove_half_written(folder: Path) -> None:
    """Remove the temporary files that a killed run left: in the folder, and in folders inside it.

    Raises:
        GaitoptError: something in the folder is not its own; see `check_folder`.
    """
    for path in check_folder(folder):
        if folder in (path.parent, path.parent.parent) and _HALF_WRITTEN.fullmatch(path.name):
            path.unlink(missing_ok=True)


def write_into(folder: Path, name: str, content: str | bytes | Callable[[Path], object]) -> Path:
    """Write one file of a folder whole or not at all, and return its path.

    Args:
        folder: the folder.
        name: name of the file, in the folder or in a folder inside it, which is made if need be.
        content: its text or its bytes, or what fills a file at the path that it is given.

    Raises:
        GaitoptError: it cannot be written.
    """
    path = folder / name
    if path.parent != folder:
        make_own_folder(path.parent)
    if isinstance(content, str):
        write_text(path, content)
    elif isinstance(content, bytes):
        write_bytes(path, content)
    else:
        write_with(path, content)
    return path


def write_problem(folder: Path, problem: Problem, model: str) -> None:
    """Write the nominal model, an MJCF, and a problem file that points to it: the folder is a problem.

    Raises:
        GaitoptError: a file that the model names has the name of a file of a run; or one cannot be written.
    """
    for name, data in assets_beside(problem).items():
        write_into(folder, name, data)
    write_into(folder, MODEL_FILE, model)
    write_into(folder, PROBLEM_FILE, problem.to_toml(MODEL_FILE))


def check_free(path: Path | None) -> None:
    """Check that a run may begin in a folder: it is new, empty, or of a run killed before its first result.

    Args:
        path: the folder; None for one that gets a free name later.

    Raises:
        GaitoptError: the folder holds something already, or the path is a file.
    """
    if path is None or not path.is_dir() or not _killed_while_made(path):
        check_new_or_empty(path)


def _killed_while_made(path: Path) -> bool:
    """Whether a folder holds the lock and the first files of a run that was killed before its first result.

    Folders inside it then hold nothing but what is half-written.
    """
    whole = {file.name for file in path.iterdir() if not _holds_nothing_whole(file)}
    return LOCK_FILE in whole and whole <= {LOCK_FILE, *FIRST_FILES, POSTERIOR_FILE}


def _holds_nothing_whole(path: Path) -> bool:
    if path.is_dir() and not path.is_symlink():
        return all(_HALF_WRITTEN.fullmatch(file.name) for file in path.iterdir())
    return _HALF_WRITTEN.fullmatch(path.name) is not None
