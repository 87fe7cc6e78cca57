"""JSON lines: a log of one object a line, as servo loggers write it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from gaitopt.core.errors import GaitoptError, found
from gaitopt.core.units import ANGLE
from gaitopt.diagnose.record.columns import COUNTS, PULSE
from gaitopt.diagnose.record.log import Log
from gaitopt.diagnose.record.log_time import LARGEST_STAMP, is_time
from gaitopt.diagnose.record.tables import LARGEST, MOST_CELLS, MOST_COLUMNS
from gaitopt.diagnose.record.trial import Flags, Series

_LONGEST_LINE = 2**20
"""A longer line is refused, characters: one of a thousand joints has 50,000."""

_MOST_LINES = 5_000_000
"""More lines are refused: an hour at 1000 samples a second has 3.6 million."""

_DEEPEST = 8
"""Most levels of objects and lists in a line."""

_ENDINGS = tuple(f"_{unit}" for unit in (*ANGLE, COUNTS, PULSE))


@dataclass
class _Key:
    """What stands under one key.

    Attributes:
        rows: number of each row that has it.
        numbers: what it holds there: NaN for null, infinity for what is no number.
        wrong: line and content where it first holds what is no number.
    """

    rows: list[int] = field(default_factory=list)
    numbers: list[float] = field(default_factory=list)
    wrong: tuple[int, object] | None = None

    def add(self, row: int, line: int, value: object) -> None:
        """Keep what a line holds."""
        number = math.nan if value is None else _number(value)
        if math.isinf(number) and self.wrong is None:
            self.wrong = (line, value)
        self.rows.append(row)
        self.numbers.append(number)


@dataclass
class _Rows:
    """The lines that have a time stamp.

    Attributes:
        path: the file, for messages.
        keys: what stands under each key.
        lines: number of each line.
        clock: key of the time stamps, once one was found.
        cells: how much all lines hold.
    """

    path: Path
    keys: dict[str, _Key] = field(default_factory=dict)
    lines: list[int] = field(default_factory=list)
    clock: str | None = None
    cells: int = 0

    def take(self, line: int, items: dict[str, object]) -> None:
        """Keep what a line holds, if it has a time stamp."""
        if self.clock is None:
            self.clock = next((n for n, value in items.items() if is_time(n) and _is_number(value)), None)
        if self.clock not in items:
            known = next((n for n, value in items.items() if n in self.keys and _is_number(value)), None)
            if known is not None:
                raise GaitoptError(f"{self.path}: line {line}: {known} without a time stamp, {self.clock}")
            return
        self.cells += len(items)
        for name, value in items.items():
            if name not in self.keys:
                self.keys[name] = _Key()
            self.keys[name].add(len(self.lines), line, value)
        self.lines.append(line)
        if self.cells > MOST_CELLS or len(self.keys) > MOST_COLUMNS:
            allowed = f"{MOST_CELLS} numbers under {MOST_COLUMNS} keys"
            raise GaitoptError(f"{self.path}: line {line}: found more; allowed: at most {allowed}")

    def column(self, name: str, largest: float = LARGEST) -> Series:
        """Return the numbers under a key, NaN where there is none, shape (n,)."""
        key = self.keys[name]
        series = np.full(len(self.lines), np.nan)
        series[key.rows] = key.numbers
        large = np.flatnonzero(np.abs(series) > largest)
        if len(large):
            line, value = key.wrong or (self.lines[large[0]], float(series[large[0]]))
            where = f"{self.path}: line {line}, {name}"
            raise GaitoptError(f"{where}: found {found(value)}; allowed: a number or null")
        return series

    def mentioned(self, name: str) -> Flags:
        """Return which lines have a key, shape (n,)."""
        flags = np.zeros(len(self.lines), dtype=bool)
        flags[self.keys[name].rows] = True
        return flags


def read_json_lines(path: Path, text: str) -> Log:
    """Return the log in a file of JSON lines. Keys of nested objects are joined by points.

    A key that a line does not have says nothing; null and NaN mean that nothing was measured, or that a servo
    is unpowered. Lines without a time stamp, such as a head, are passed over if they hold nothing of the log.

    Args:
        path: the file, for messages.
        text: its content.

    Raises:
        GaitoptError: a line is no JSON object, too long or too deep, a key appears twice, there are too many
            numbers, or no time stamps.
    """
    count = text.count("\n")
    if count > _MOST_LINES:
        raise GaitoptError(f"{path}: found {count} lines; allowed: at most {_MOST_LINES}")
    decoder, rows = json.JSONDecoder(object_pairs_hook=_unique), _Rows(path)
    for line, part in enumerate(text.split("\n"), start=1):
        if part and not part.isspace():
            items: dict[str, object] = {}
            _flatten(_object(path, line, part, decoder), "", items, f"{path}: line {line}")
            rows.take(line, items)
    if rows.clock is None:
        raise GaitoptError(f"{path}: no time stamps; allowed: a key such as t_s or timestamp, with a number")
    head = [name for name in rows.keys if not is_time(name)]
    stamps = rows.column(rows.clock, LARGEST_STAMP)
    return Log(path, path.stem, rows.clock, stamps, np.array(rows.lines), head, rows.column, rows.mentioned)


def _object(path: Path, line: int, text: str, decoder: json.JSONDecoder) -> dict[str, object]:
    """Return the object in a line."""
    where = f"{path}: line {line}"
    if len(text) > _LONGEST_LINE:
        raise GaitoptError(f"{where}: found {len(text)} characters; allowed: at most {_LONGEST_LINE} a line")
    try:
        content = decoder.decode(text)
    except RecursionError:
        raise GaitoptError(f"{where}: not JSON: nested too deep") from None
    except _TwiceError as error:
        raise GaitoptError(f"{where}: key {found(str(error))} appears twice") from None
    except ValueError as error:
        raise GaitoptError(f"{where}: not JSON: {error}") from None
    if not isinstance(content, dict):
        allowed = 'one object a line, such as {"t_s": 0.1}'
        raise GaitoptError(f"{where}: found {found(content)}; allowed: {allowed}")
    return content


class _TwiceError(Exception):
    """A key that an object has twice."""


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        raise _TwiceError(next(name for name in names if names.count(name) > 1))
    return content


def _flatten(content: object, name: str, items: dict[str, object], where: str, depth: int = 0) -> None:
    """Put what an object holds under its full name."""
    if depth > _DEEPEST:
        raise GaitoptError(f"{where}: nested too deep; allowed: at most {_DEEPEST} levels")
    inner = content.items() if isinstance(content, dict) else enumerate(content)  # type: ignore[arg-type]
    for key, value in inner:
        full = _joined(name, str(key))
        if isinstance(value, (dict, list)):
            _flatten(value, full, items, where, depth + 1)
        elif full in items:
            raise GaitoptError(f"{where}: key {found(full)} appears twice")
        else:
            items[full] = value


@lru_cache(maxsize=MOST_COLUMNS)
def _joined(group: str, key: str) -> str:
    """Return the name of a member of a group. The unit of a group is that of its members."""
    unit = next((ending for ending in _ENDINGS if group.endswith(ending)), "")
    own = "" if key.endswith(_ENDINGS) else unit
    return f"{group.removesuffix(unit)}.{key}{own}" if group else key


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number(value: object) -> float:
    """Return a number, or infinity for what is none."""
    try:
        return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.inf
    except OverflowError:  # an integer of hundreds of digits
        return math.inf
