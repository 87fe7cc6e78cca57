"""Parquet files, read in a process of their own.

pyarrow ends the process on some broken files, and a small file may unfold to any size. The process has a
limit of memory; whatever happens to it is one line here.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_bytes
from gaitopt.core.text import one_line
from gaitopt.optimise.processes import LostWorkersError, ProcessExecutor

if TYPE_CHECKING:
    from pyarrow import Array, Table

Columns = dict[str, NDArray[np.float64]]
"""Numbers by column, each of shape (n, numbers in a row)."""

_MEMORY = 6 * 2**30
"""Most memory of the process that reads, bytes: 20 million numbers take 0.5 GiB, the libraries 3 GiB of
addresses."""

_SHOWN = 20
"""Columns that a message lists."""


def read_parquet(paths: Sequence[Path], columns: Sequence[str], most: int) -> list[Columns]:
    """Return columns of some Parquet files: of numbers, or of lists of numbers of equal length.

    Args:
        paths: the files.
        columns: the columns' names.
        most: most numbers in all files.

    Raises:
        GaitoptError: pyarrow is missing, a file is broken, there are too many numbers, or a column is missing
            or holds something else.
    """
    if find_spec("pyarrow") is None:
        raise GaitoptError("LeRobot data sets need pyarrow: pip install gaitopt[lerobot]")
    tables: list[Columns] = []
    with _no_program(), ProcessExecutor(1, lives=1) as executor:
        for path in paths:
            try:
                tables.append(executor.submit(parquet_columns, path, columns, most).result())
            except LostWorkersError:
                raise GaitoptError(f"{path}: no Parquet file that can be read") from None
            most -= sum(numbers.size for numbers in tables[-1].values())
    return tables


@contextmanager
def _no_program() -> Iterator[None]:
    """Let no worker process run the program that called: a script may do its work when it is imported."""
    program = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = program


def parquet_columns(path: Path, columns: Sequence[str], most: int) -> Columns:
    """Return the columns of one file: the work of the process.

    Args:
        path: the file.
        columns: the columns' names.
        most: most numbers.

    Raises:
        GaitoptError: see `read_parquet`.
    """
    _limit()
    import pyarrow as arrow
    from pyarrow import parquet

    data = read_bytes(path)
    try:
        file = parquet.ParquetFile(arrow.BufferReader(data))
        names = file.schema_arrow.names
        missing = next((name for name in columns if name not in names), None)
        if missing is not None:
            raise GaitoptError(f"{path}: no column {missing}; found: {', '.join(names[:_SHOWN]) or 'none'}")
        _check_count(path, file.metadata.num_rows * len(columns), most)
        table = file.read(columns=list(columns), use_threads=False)
        if table.num_rows == 0:
            raise GaitoptError(f"{path}: no rows")
        lists = {name: _values(path, table, name, arrow) for name in columns}
    except (arrow.ArrowException, OSError, ValueError, MemoryError, OverflowError) as error:
        raise GaitoptError(f"{path}: no Parquet file that can be read: {one_line(error)[:200]}") from None
    _check_count(path, sum(map(len, lists.values())), most)
    arrays = {}
    for name, values in lists.items():
        numbers = np.array(values.to_numpy(zero_copy_only=False), dtype=float)
        arrays[name] = numbers.reshape(table.num_rows, len(numbers) // table.num_rows)
    return arrays


def _limit() -> None:
    """Limit the memory of this process, and write no core file if it is ended."""
    os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"  # the others reserve addresses
    with suppress(ImportError, ValueError, OSError):  # not on Windows; a lower limit may be set already
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))


def _check_count(path: Path, count: int, most: int) -> None:
    if count > most:
        raise GaitoptError(
            f"{path}: found {count} numbers; allowed: at most {most} in this and the next files"
        )


def _values(path: Path, table: Table, name: str, arrow: ModuleType) -> Array:
    """Return the numbers of a column, one list after the other."""
    import pyarrow.compute

    column, kinds = table.column(name).combine_chunks(), arrow.types
    varying = kinds.is_list(column.type) or kinds.is_large_list(column.type)
    if not varying and not kinds.is_fixed_size_list(column.type):
        values = column
    elif column.null_count:
        raise GaitoptError(f"{path}: {name}: {column.null_count} rows without a list")
    elif varying and len(pyarrow.compute.list_value_length(column).unique()) > 1:
        raise GaitoptError(f"{path}: {name}: lists differ in length; allowed: equal ones")
    else:
        values = column.flatten()
    if not (kinds.is_floating(values.type) or kinds.is_integer(values.type)):
        raise GaitoptError(f"{path}: {name}: found {column.type}; allowed: numbers, or lists of them")
    return values
