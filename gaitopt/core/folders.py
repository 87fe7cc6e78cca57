"""Folders that a command makes: new or empty before, complete or gone after."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gaitopt.core.errors import GaitoptError, MachineError


def check_new_or_empty(path: Path | None) -> None:
    """Check that a folder may be made or filled, before anything is computed for it.

    Args:
        path: the folder; None for one that gets a free name later.

    Raises:
        GaitoptError: the folder holds something already, or the path is a file.
    """
    if path is None or not path.exists():
        return
    if not path.is_dir():
        raise GaitoptError(f"--out: {path} is a file; allowed: a new or an empty folder")
    if any(path.iterdir()):
        raise not_empty(path)


def not_empty(path: Path) -> GaitoptError:
    """Return the error for a folder that holds something already."""
    return GaitoptError(f"--out: {path} is not empty; allowed: a new or an empty folder")


@contextmanager
def filling(folder: Path) -> Iterator[None]:
    """Make a folder, or take an empty one, and fill it; on an error, remove all that was written.

    Raises:
        GaitoptError: the folder or a file cannot be written.
    """
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        for path in folder.iterdir() if folder.is_dir() else ():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        if made and folder.is_dir():
            folder.rmdir()
        if isinstance(error, OSError):
            raise MachineError(f"{folder}: cannot be written: {error.strerror}") from None
        raise
