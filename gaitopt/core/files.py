"""Reading and writing whole files.

Only plain files up to a size are read: no pipes, devices or folders, so that no read waits or has no end. A
file is written completely or not at all. An existing file is replaced only if it is a plain file that may be
written and that the command has not read (see `noting_reads`). Its mode is kept. A link is not followed and
not replaced, and other names of the old file (hard links) keep the old content.
"""

from __future__ import annotations

import io
import json
import os
import re
import stat
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np

from gaitopt.core.errors import GaitoptError, MachineError
from gaitopt.core.interrupts import interrupts_held

MIB = 2**20
"""Bytes in a mebibyte."""

LARGEST_FILE = 256 * MIB
"""A larger file is refused, bytes: a recording of an hour at 1000 frames a second has fewer."""

LARGEST_TEXT = 16 * MIB
"""A larger MJCF, JSON file or gait table is refused, bytes; the largest here has 0.1 MiB."""

LARGEST_TOML = 4 * MIB
"""A larger TOML file is refused, bytes: Python reads about one MiB a second."""

_MOST_PARTS = 64

_LONG_KEY = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{_MOST_PARTS}}}""",
    re.ASCII,
)
"""A key with dots, such as ``a.b.c``. Python takes 46 s for one of 40,000 parts, and longer for more."""

_DEEPEST = 100
"""Most levels of lists and tables in a TOML or JSON file; files of gaitopt have fewer than 10."""

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFLNK: "a link",
}

_FileId = tuple[int, int]
"""Device and inode of a file: the same for all of its names."""

_NEW_MODE = 0o644
"""Mode of a file that is new."""

_read_files: ContextVar[set[_FileId] | None] = ContextVar("read_files", default=None)


def read_text(path: Path, largest: int = LARGEST_FILE) -> str:
    """Return the text of a UTF-8 file.

    Args:
        path: the file; a link is followed.
        largest: the most that is read, bytes.

    Raises:
        GaitoptError: the file is missing, no plain file, too large, unreadable or not UTF-8, or it changed
            while it was read.
    """
    try:
        return io.TextIOWrapper(io.BytesIO(_content(path, largest)), encoding="utf-8-sig").read()
    except FileNotFoundError:
        raise GaitoptError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise GaitoptError(f"{path}: not UTF-8 text (byte {error.start})") from None
    except OSError as error:
        raise MachineError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise GaitoptError(f"{path}: cannot be read: a null byte in its name") from None


def read_bytes(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """Return the content of a file.

    Args:
        path: the file; a link is followed.
        largest: the most that is read, bytes.

    Raises:
        GaitoptError: the file is missing, no plain file, too large or unreadable, or it changed while it
            was read.
    """
    try:
        return _content(path, largest)
    except OSError as error:
        raise MachineError(f"{path}: cannot be read: {error.strerror}") from None


def _content(path: Path, largest: int) -> bytes:
    """Return the content of a plain file, and check by size and time stamp that it did not change meanwhile.

    What is no plain file is not opened. One that takes its place at that moment is opened without waiting
    and refused by what its descriptor says.
    """
    _check_plain(path, path.stat())
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    with os.fdopen(descriptor, "rb") as file:
        before = os.fstat(descriptor)
        _check_plain(path, before)
        data = file.read(largest + 1) if before.st_size <= largest else b""
        after = os.fstat(descriptor)
    if max(before.st_size, len(data)) > largest:
        size = max(before.st_size, len(data)) / MIB
        raise GaitoptError(f"{path}: found {size:.4g} MiB; allowed: at most {largest / MIB:g} MiB")
    changed = (before.st_mtime_ns, before.st_size) != (after.st_mtime_ns, after.st_size)
    if changed or len(data) != after.st_size:
        raise GaitoptError(f"{path}: it changed while it was read; try again")
    noted = _read_files.get()
    if noted is not None:
        noted.add((after.st_dev, after.st_ino))
    return data


def kind_of(status: os.stat_result) -> str | None:
    """Return what stands in place of a plain file, in words; None for a plain file."""
    kind = stat.S_IFMT(status.st_mode)
    return None if kind == stat.S_IFREG else _KINDS.get(kind, "no file")


def _check_plain(path: Path, status: os.stat_result) -> None:
    kind = kind_of(status)
    if kind is not None:
        raise GaitoptError(f"{path}: found {kind}; allowed: a plain file")


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file as a dictionary.

    Raises:
        GaitoptError: the file cannot be read, or is not TOML.
    """
    text = read_text(path, LARGEST_TOML)
    if _LONG_KEY.search(text):
        raise GaitoptError(f"{path}: not TOML: found a key of more than {_MOST_PARTS} parts; allowed: fewer")
    try:
        content = tomllib.loads(text)
    except ValueError as error:  # a TOMLDecodeError, or another for a number of 5000 digits
        raise GaitoptError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise GaitoptError(f"{path}: not TOML: nested too deep") from None
    _check_depth(path, content)
    return content


def read_json(path: Path) -> Any:
    """Return the content of a JSON file.

    Raises:
        GaitoptError: the file cannot be read, or is not JSON.
    """
    text = read_text(path, LARGEST_TEXT)
    try:
        content = json.loads(text)
    except ValueError as error:
        raise GaitoptError(f"{path}: not JSON: {error}") from None
    except RecursionError:
        raise GaitoptError(f"{path}: not JSON: nested too deep") from None
    _check_depth(path, content)
    return content


def _check_depth(path: Path, content: object) -> None:
    """Check how deep lists and tables are nested: what checks and prints them calls itself at each level."""
    level: list[object] = [content]
    for _ in range(_DEEPEST):
        level = [item for one in level for item in _items(one)]
        if not level:
            return
    raise GaitoptError(f"{path}: nested too deep; allowed: at most {_DEEPEST} levels")


def _items(content: object) -> Iterable[object]:
    if isinstance(content, dict):
        return content.values()
    return content if isinstance(content, list) else ()


def inside(folder: Path, name: str) -> Path | None:
    """Return the path of a file that another file names, or None where it is not in the same folder.

    The name is relative to the folder, and goes down from it alone: without "..".
    """
    try:
        if Path(name).is_absolute() or ".." in Path(name).parts:
            return None
        path = folder / name
        path.exists()  # raises if the name is too long
        return path if path.resolve().is_relative_to(folder.resolve()) else None
    except (ValueError, RuntimeError, OSError):  # a null byte, links in a circle, a name that is too long
        return None


def found_inside(folder: Path, name: str) -> Path | None:
    """Return the path of a plain file in a folder, or None where there is none.

    It is for a file that a folder has by its name, without anyone naming it: a problem file, a data set's
    file. As such a folder may be a stranger's, the file may be no link out of it.

    Raises:
        GaitoptError: it is a link out of the folder.
    """
    if not (folder / name).is_file():
        return None
    path = inside(folder, name)
    if path is None:
        raise GaitoptError(f"{folder / name}: found a link out of its folder; allowed: a file inside it")
    return path


@contextmanager
def noting_reads(*paths: Path) -> Iterator[None]:
    """Note which files are read meanwhile: `write_with` does not replace them.

    Args:
        paths: files that were read before.
    """
    noted: set[_FileId] = set(_read_files.get() or ())
    for path in paths:
        with suppress(OSError):
            status = path.stat()
            noted.add((status.st_dev, status.st_ino))
    token = _read_files.set(noted)
    try:
        yield
    finally:
        _read_files.reset(token)


def check_replaceable(path: Path) -> int | None:
    """Check that a file can be written, before anything is computed for it.

    Returns:
        The mode of the file that is to be replaced; None where there is none.

    Raises:
        GaitoptError: there is a file that is not to be replaced: a link, a pipe, a device, a folder, a file
            without write permission, or one that the command reads.
    """
    try:
        status = path.lstat()
    except (OSError, ValueError):  # it is not there; what else is wrong shows when it is written
        return None
    kind = kind_of(status)
    if kind is not None:
        raise GaitoptError(
            f"{path}: cannot be written: found {kind}; allowed: a new file, or a plain one to replace"
        )
    if (status.st_dev, status.st_ino) in (_read_files.get() or ()):
        raise GaitoptError(f"{path}: cannot be written: the command reads it; allowed: another file")
    if not os.access(path, os.W_OK):
        raise GaitoptError(f"{path}: cannot be written: Permission denied")
    return stat.S_IMODE(status.st_mode)


def write_with(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file through `write`, which fills a temporary file beside it that is then renamed.

    Raises:
        GaitoptError: the folder or file cannot be written; see `check_replaceable`.
    """
    check_replaceable(path)
    try:
        with ExitStack() as stack:
            with interrupts_held():  # so that no file is made that nobody removes
                handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
                os.close(handle)
                temporary = Path(name)
                stack.callback(temporary.unlink, missing_ok=True)
            write(temporary)
            mode = check_replaceable(path)
            temporary.chmod(_NEW_MODE if mode is None else mode)
            temporary.replace(path)
    except OSError as error:
        raise MachineError(f"{path}: cannot be written: {error.strerror or error}") from None


def write_text(path: Path, text: str) -> None:
    """Write a text file completely or not at all.

    Raises:
        GaitoptError: it cannot be written, or it has the name of a file that is not Unicode text.
    """
    try:
        data = text.encode()
    except UnicodeEncodeError:
        raise GaitoptError(f"{path}: cannot be written: a name in it is no Unicode text") from None
    write_bytes(path, data)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file completely or not at all.

    Raises:
        GaitoptError: it cannot be written.
    """
    write_with(path, lambda temporary: temporary.write_bytes(data))


def csv_text(columns: dict[str, np.ndarray], nan: str = "nan") -> str:
    """Return a CSV table of columns of equal length, each float with as few digits as read back the same.

    Args:
        columns: the columns by name.
        nan: what stands for NaN.
    """

    def text(cell: float) -> str:
        return repr(cell) if cell == cell else nan

    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr if nan == "nan" else text, row)) for row in rows)]
    return "\n".join(lines) + "\n"
