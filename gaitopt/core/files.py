"""Reading and writing whole files. A file is written completely or not at all."""

from __future__ import annotations

import io
import json
import os
import stat
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gaitopt.core.errors import GaitoptError


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file.

    Raises:
        GaitoptError: the file is missing, unreadable or not UTF-8, or it changed while it was read.
    """
    try:
        return io.TextIOWrapper(io.BytesIO(_content(path)), encoding="utf-8-sig").read()
    except FileNotFoundError:
        raise GaitoptError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise GaitoptError(f"{path}: not UTF-8 text (byte {error.start})") from None
    except OSError as error:
        raise GaitoptError(f"{path}: cannot be read: {error.strerror}") from None


def read_bytes(path: Path) -> bytes:
    """Return the content of a file.

    Raises:
        GaitoptError: the file is missing or unreadable, or it changed while it was read.
    """
    try:
        return _content(path)
    except OSError as error:
        raise GaitoptError(f"{path}: cannot be read: {error.strerror}") from None


def _content(path: Path) -> bytes:
    """Return the content of a file, and check by size and time stamp that it did not change meanwhile."""
    with path.open("rb") as file:
        before = os.fstat(file.fileno())
        data = file.read()
        after = os.fstat(file.fileno())
    changed = (before.st_mtime_ns, before.st_size) != (after.st_mtime_ns, after.st_size)
    if stat.S_ISREG(after.st_mode) and (changed or len(data) != after.st_size):
        raise GaitoptError(f"{path}: it changed while it was read; try again")
    return data


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file as a dictionary.

    Raises:
        GaitoptError: the file cannot be read, or is not TOML.
    """
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except ValueError as error:  # a TOMLDecodeError, or another for a number of 5000 digits
        raise GaitoptError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise GaitoptError(f"{path}: not TOML: nested too deep") from None


def read_json(path: Path) -> Any:
    """Return the content of a JSON file.

    Raises:
        GaitoptError: the file cannot be read, or is not JSON.
    """
    text = read_text(path)
    try:
        return json.loads(text)
    except ValueError as error:
        raise GaitoptError(f"{path}: not JSON: {error}") from None
    except RecursionError:
        raise GaitoptError(f"{path}: not JSON: nested too deep") from None


def inside(folder: Path, name: str) -> Path | None:
    """Return the path of a file that another file names, or None where it is not in the same folder."""
    try:
        path = folder / name
        path.exists()  # raises if the name is too long
        return path if path.resolve().is_relative_to(folder.resolve()) else None
    except (ValueError, RuntimeError, OSError):  # a null byte, links in a circle, a name that is too long
        return None


def write_with(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file through `write`, which fills a temporary file beside it that is then renamed.

    Raises:
        GaitoptError: the folder or file cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        try:
            write(temporary)
            temporary.chmod(0o644)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise GaitoptError(f"{path}: cannot be written: {error.strerror or error}") from None


def write_text(path: Path, text: str) -> None:
    """Write a text file completely or not at all.

    Raises:
        GaitoptError: it cannot be written, or it has the name of a file that is not Unicode text.
    """
    try:
        data = text.encode()
    except UnicodeEncodeError:
        raise GaitoptError(f"{path}: cannot be written: a name in it is no Unicode text") from None
    write_with(path, lambda temporary: temporary.write_bytes(data))


def csv_text(columns: dict[str, np.ndarray]) -> str:
    """Return a CSV table of columns of equal length, each float with as few digits as read back the same."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"
