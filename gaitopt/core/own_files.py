"""Files of a folder that may be a stranger's, such as a run folder or blind cases that somebody sent.

The path of the folder itself is the user's: its links are followed. Nothing below it is followed out of it.
Every entry is a folder or a plain file with one name: no link, no second name (hard link), no pipe or device.
`check_folder` checks that of a whole folder, before anything in it is read. `open_own` checks it again of the
one file that it opens to write, by its descriptor.

A folder that somebody else changes at that moment is not covered: its folders are opened by their paths.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from gaitopt.core.errors import GaitoptError, MachineError
from gaitopt.core.files import kind_of

_MOST_ENTRIES = 100_000
"""A folder with more entries is refused: a run folder has some 30, and a long diagnosis some 10,000."""

_SAFELY = (
    os.O_CLOEXEC | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
)
"""Flags that follow no link and wait for no pipe; Windows does not have all of them."""


def check_folder(folder: Path) -> list[Path]:
    """Check that everything in a folder is the folder's own, and return the files.

    Raises:
        GaitoptError: it has a link, a file with a second name, a pipe, a socket or a device, it has too
            many entries, or it cannot be read.
    """
    files: list[Path] = []
    folders, seen = [folder], 0
    while folders:
        try:
            entries = sorted(folders.pop().iterdir())
        except OSError as error:
            raise GaitoptError(f"{folder}: cannot be read: {error.strerror}") from None
        seen += len(entries)
        if seen > _MOST_ENTRIES:
            raise GaitoptError(f"{folder}: found more than {_MOST_ENTRIES} entries; allowed: a run folder")
        for path in entries:
            (folders if _is_own_folder(path) else files).append(path)
    return files


def open_own(path: Path, flags: int) -> int:
    """Open a file of a folder by its own name, and return the descriptor.

    Args:
        path: the file.
        flags: flags of `os.open`. Nothing is cut to length 0 while it is opened: `os.ftruncate` it then.

    Raises:
        GaitoptError: it is no plain file with one name.
        OSError: it cannot be opened.
    """
    check_own(path)
    descriptor = os.open(path, flags | _SAFELY, 0o644)
    try:
        _check(path, os.fstat(descriptor))
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def check_own(path: Path) -> bool:
    """Check that a file, where there is one, is a plain file with one name; return whether there is one.

    Raises:
        GaitoptError: it is something else.
    """
    try:
        status = path.lstat()
    except FileNotFoundError:
        return False
    except OSError as error:
        raise GaitoptError(f"{path}: cannot be read: {error.strerror}") from None
    _check(path, status)
    return True


def make_own_folder(path: Path) -> None:
    """Make a folder inside a folder, which is made if need be, or take the one that is there.

    Raises:
        GaitoptError: it is a link or a file, or cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir()
    except FileExistsError:
        if not _is_own_folder(path):
            raise GaitoptError(f"{path}: found a file; allowed: a folder") from None
    except OSError as error:
        raise MachineError(f"{path}: cannot be made: {error.strerror}") from None


def _is_own_folder(path: Path) -> bool:
    """Return whether a path is a folder, not a link to one; check a file."""
    try:
        status = path.lstat()
    except FileNotFoundError:  # gone by now
        return False
    except OSError as error:
        raise GaitoptError(f"{path}: cannot be read: {error.strerror}") from None
    if stat.S_ISDIR(status.st_mode):
        return True
    _check(path, status)
    return False


def _check(path: Path, status: os.stat_result) -> None:
    kind = kind_of(status)
    if kind is None and status.st_nlink > 1:
        kind = f"a file with {status.st_nlink} names (hard links)"
    if kind is not None:
        raise GaitoptError(f"{path}: found {kind}; allowed in this folder: plain files with one name")
