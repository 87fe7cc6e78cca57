"""A table of a study, kept row by row, so that the study can continue."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from gaitopt.core.files import write_text

Row = dict[str, str]


class KeptTable:
    """A CSV file that grows row by row and keeps what an earlier run has written."""

    def __init__(self, path: Path, keys: Sequence[str]):
        """Read the existing file.

        Args:
            path: the file.
            keys: columns that together identify a row, or a group of rows.
        """
        self.path = path
        self.keys = keys
        self.rows: list[Row] = []
        if path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                self.rows = list(csv.DictReader(file))

    def find(self, **key: str) -> list[Row]:
        """Return the rows with these values."""
        return [row for row in self.rows if all(row[name] == value for name, value in key.items())]

    def fill(self, key: Row, make: Callable[[], Iterable[Row]]) -> list[Row]:
        """Return the rows of a key; if they do not exist, make them and write the file."""
        assert tuple(key) == tuple(self.keys)
        found = self.find(**key)
        if not found:
            found = [key | row for row in make()]
            same = {name: value for name, value in key.items() if name != "model"}
            stale = self.find(**same)
            self.rows = [row for row in self.rows if row not in stale] + found
            self.write()
            print(f"{self.path.name}: " + ", ".join(f"{k} {v}" for k, v in found[-1].items()), flush=True)
        return found

    def write(self) -> None:
        """Write the complete file."""
        text = io.StringIO()
        columns = dict.fromkeys(name for row in self.rows for name in row)
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        write_text(self.path, text.getvalue())
