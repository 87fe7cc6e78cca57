"""Tables of numbers in text files: cells of text are read, and columns of numbers are returned."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError, found, unknown_name
from gaitopt.core.files import read_text
from gaitopt.core.numbers import number

LARGEST = 1e12
"""No camera, clock or servo gives a larger number, in any unit."""

MOST_CELLS = 20_000_000
"""A table of more cells or lines is refused: an hour at 240 frames a second in 20 columns has 17 million."""

MOST_COLUMNS = 10_000

_LINE_ENDS = "\n\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"
"""What `str.splitlines` takes for the end of a line."""

_MISSING = {"", "nan", "na", "n/a", "none", "null", "-"}

_HEAD_LINES = 500
"""Lines from which the delimiter of a file is found."""

Cells = Sequence[Sequence[str]]
"""Cells of text by row."""


@dataclass(frozen=True)
class TextTable:
    """Cells of text in named columns.

    Attributes:
        source: the file.
        head: the columns' names.
        rows: cells; a row that is shorter than the names ends in blank cells.
        first_line: line of the file on which the first row stands, for messages.
        decimal: the decimal mark.
    """

    source: Path
    head: tuple[str, ...]
    rows: Cells
    first_line: int
    decimal: str = "."

    def column(self, name: str, largest: float = LARGEST) -> NDArray[np.float64]:
        """Return a column as numbers, NaN where a cell is blank, shape (n,).

        Args:
            name: the column.
            largest: a larger number is refused.

        Raises:
            GaitoptError: there is no such column, or two of this name, or a cell is not a number.
        """
        if name not in self.head:
            raise unknown_name(self.source, "column", name, self.head)
        if self.head.count(name) > 1:
            raise GaitoptError(f"{self.source}: column {name!r} appears twice")
        index = self.head.index(name)
        numbers = np.empty(len(self.rows))
        for at, row in enumerate(self.rows):
            numbers[at] = self._number(row[index], name, at, largest) if index < len(row) else math.nan
        return numbers

    def _number(self, cell: str, name: str, row: int, largest: float) -> float:
        text = cell.strip().replace("\N{MINUS SIGN}", "-")
        if text.lower() in _MISSING:
            return math.nan
        try:
            value = number(text.replace(self.decimal, "."))
        except ValueError:
            value = math.inf
        if not abs(value) <= largest:
            where = f"{self.source}: line {self.first_line + row}, column {name}"
            raise GaitoptError(f"{where}: found {found(cell)}; allowed: a number or nothing")
        return value


def read_rows(path: Path, delimiter: str = ",", lines: int | None = None) -> list[list[str]]:
    """Return the cells of a delimited text file, stripped; an empty line is an empty row.

    Args:
        path: the file.
        delimiter: what separates its cells.
        lines: how many lines to read; all by default.

    Raises:
        GaitoptError: the file cannot be read, is broken, or has too many cells.
    """
    text = read_text(path)
    cells = sum(map(text.count, _LINE_ENDS)) + (text.count(delimiter) if lines is None else 0)
    if cells > MOST_CELLS:
        raise GaitoptError(f"{path}: found {cells} cells and lines; allowed: at most {MOST_CELLS}")
    try:
        rows = list(
            csv.reader(
                text.splitlines()[:lines],
                delimiter=delimiter,
                skipinitialspace=delimiter != "\t",
                strict=False,
            )
        )
    except csv.Error as error:
        raise GaitoptError(f"{path}: not a table: {error}") from None
    return [[cell.strip() for cell in row] for row in rows]


def read_cells(path: Path) -> list[list[str]]:
    """Return the cells of a text file with any usual delimiter, without empty rows.

    The delimiter is the one that gives most of the first rows the same number of cells.

    Raises:
        GaitoptError: the file cannot be read, is broken, or is empty.
    """
    heads = {mark: _filled(read_rows(path, mark, _HEAD_LINES)) for mark in ("\t", ";", ",", " ")}
    rows = _filled(read_rows(path, max(heads, key=lambda mark: _agreement(heads[mark]))))
    if not rows:
        raise GaitoptError(f"{path}: empty")
    return rows


def decimal_mark(rows: Cells) -> str:
    """Return the decimal mark: a comma where cells hold numbers with commas and none with a point."""
    cells = [cell for row in rows for cell in row if any(letter.isdigit() for letter in cell)]
    return "," if any("," in cell for cell in cells) and not any("." in cell for cell in cells) else "."


def table(path: Path, rows: Cells, head: Sequence[str], begin: int, decimal: str = ".") -> TextTable:
    """Return the rows from index `begin` under the names `head`.

    Raises:
        GaitoptError: there are no rows or too many columns, or a row is longer than the names.
    """
    if len(head) > MOST_COLUMNS:
        raise GaitoptError(f"{path}: found {len(head)} columns; allowed: at most {MOST_COLUMNS}")
    filled = []
    for index, row in enumerate(rows[begin:]):
        if len(row) > len(head) and any(row[len(head) :]):
            line = begin + index + 1
            raise GaitoptError(f"{path}: line {line}: {len(row)} cells under {len(head)} column names")
        if any(row):
            filled.append(row)
    if not filled:
        raise GaitoptError(f"{path}: no numbers under the column names")
    return TextTable(path, tuple(head), filled, begin + 1, decimal)


def read_csv(path: Path) -> TextTable:
    """Return a plain CSV table: one row of names, then numbers.

    Raises:
        GaitoptError: the file cannot be read or is not such a table.
    """
    rows = read_rows(path)
    if not rows or not any(rows[0]):
        raise GaitoptError(f"{path}: no column names on its first line")
    return table(path, rows, rows[0], begin=1)


def _filled(rows: Sequence[list[str]]) -> list[list[str]]:
    return [row for row in rows if any(row)]


def _agreement(rows: Cells) -> tuple[bool, float]:
    """Return whether rows have several cells, and the share of them that have the most common number."""
    widths = [len(row) for row in rows]
    if not widths:
        return False, 0.0
    usual = max(set(widths), key=widths.count)
    return usual > 1, widths.count(usual) / len(widths)
