"""Folders that a command makes: new or empty before, complete or gone after."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

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
def filled(folder: Path) -> Iterator[Path]:
    """Yield an empty folder to write into, which is `folder` once all is written; an error leaves nothing.

    A new folder has another name until then: even where the process is killed, it is complete or not there.
    An empty one is filled in its place, as it may be the root of a disk.

    Raises:
        GaitoptError: the folder or a file cannot be written.
    """
    try:
        with _in_place(folder) if folder.exists() else _renamed(folder) as place:
            yield place
    except OSError as error:
        raise MachineError(f"{folder}: cannot be written: {error.strerror or error}") from None


@contextmanager
def _in_place(folder: Path) -> Iterator[Path]:
    try:
        yield folder
    except BaseException:
        for path in folder.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        raise


@contextmanager
def _renamed(folder: Path) -> Iterator[Path]:
    folder.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
        whole = Path(temporary) / folder.name  # with the usual rights, unlike a temporary folder
        whole.mkdir()
        try:
            yield whole
        except GaitoptError as error:  # says the name that the user knows
            raise type(error)(str(error).replace(str(whole), str(folder))) from None
        whole.rename(folder)
