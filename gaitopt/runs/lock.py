"""The lock of a folder: one run at a time works in it."""

from __future__ import annotations

import os
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from gaitopt.core.errors import MachineError
from gaitopt.core.own_files import open_own

LOCK_FILE = ".lock"

_ASKED_S = 0.05
"""Longest that `is_held` holds a lock, s, by far."""


class FolderLock:
    """The lock of one folder. The operating system releases it when the process ends, however it ends."""

    def __init__(self, folder: Path):
        self._path = folder / LOCK_FILE
        self._file: BinaryIO | None = None

    def take(self) -> None:
        """Take the lock; do nothing where this object already holds it.

        Raises:
            GaitoptError: another run holds it, or the folder cannot be written.
        """
        if self._file is None:
            self._file = _locked(self._path)

    def release(self) -> None:
        """Remove the lock file and release the lock, in the order that leaves no gap for a third run."""
        file, self._file = self._file, None
        if file is None:
            return
        with suppress(OSError):
            if sys.platform == "win32":
                file.close()
            self._path.unlink(missing_ok=True)
            file.close()


def is_held(folder: Path) -> bool:
    """Whether a run is working in a folder; what the system cannot say counts as no.

    Raises:
        GaitoptError: the lock is no plain file.
    """
    if sys.platform == "win32":
        return (folder / LOCK_FILE).exists()
    import fcntl

    try:
        descriptor = open_own(folder / LOCK_FILE, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


def _locked(path: Path) -> BinaryIO:
    """Return the open and locked file."""
    file: BinaryIO | None = None
    try:
        file = os.fdopen(open_own(path, os.O_RDWR | os.O_CREAT), "r+b", buffering=0)
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                time.sleep(_ASKED_S)  # somebody may only have asked whether it is held
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not path.exists() or os.fstat(file.fileno()).st_ino != path.stat().st_ino:
                file.close()  # its owner removed it after it was opened
                return _locked(path)
    except OSError as error:
        if file is not None:
            file.close()
            raise MachineError(f"{path.parent}: another run is working in this folder") from None
        raise MachineError(f"{path}: cannot be written: {error.strerror}") from None
    return file
