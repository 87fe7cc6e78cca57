"""``evaluations.csv`` as a reader sees it: figures of each gait, while the run goes on, too.

Nothing is checked by its digest and nothing is written here; a search that goes on reads its journal by
`optimise.journal`.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import LARGEST_FILE, MIB
from gaitopt.core.own_files import check_own, open_own
from gaitopt.core.text import shortened
from gaitopt.optimise.journal import WORKING
from gaitopt.runs.folder import JOURNAL_FILE
from gaitopt.simulation.metrics import SPEED

_POINT = "x."
"""What the columns of coordinates begin with."""


@dataclass(frozen=True)
class Evaluations:
    """What a journal says, gait by gait.

    Attributes:
        cost: costs, shape (n,).
        speed_m_s: mean forward speeds, m/s, NaN where there is none, shape (n,).
        constraints_met: whether every constraint holds, shape (n,).
        working: whether the working fidelity judged it: costs of other rungs are of other robots, shape (n,).
        points: the coordinates in the gait space by name, each of shape (n,).
    """

    cost: NDArray[np.float64]
    speed_m_s: NDArray[np.float64]
    constraints_met: NDArray[np.bool_]
    working: NDArray[np.bool_]
    points: Mapping[str, NDArray[np.float64]]

    def __len__(self) -> int:
        return len(self.cost)

    @property
    def improvements(self) -> NDArray[np.intp]:
        """Indices of the gaits that were better than all before them at the working fidelity, in order."""
        costs = np.where(self.working, self.cost, np.inf)
        before = np.concatenate(([np.inf], np.minimum.accumulate(costs)[:-1]))
        return np.flatnonzero(costs < before)


class JournalReader:
    """Reads the journal of a run that may go on: each time, only what is new."""

    def __init__(self, folder: Path):
        self._path = folder / JOURNAL_FILE
        self._place = 0
        self._cells: dict[str, list[str]] = {}

    def read(self) -> Evaluations:
        """Return the evaluations so far. A last row that is not written to its end is left out.

        Raises:
            GaitoptError: the file is missing, no plain file of the folder, or no journal.
        """
        if not check_own(self._path):
            raise GaitoptError(f"{self._path}: no such file")
        try:
            self._take(self._new_lines())
            return self._evaluations()
        except (ValueError, csv.Error) as error:
            text = shortened(str(error), 200)
            raise GaitoptError(f"{self._path}: not the journal of a run: {text}") from None
        except OSError as error:
            raise GaitoptError(f"{self._path}: cannot be read: {error.strerror}") from None

    def _new_lines(self) -> list[str]:
        """Return the whole lines that were not read yet."""
        with os.fdopen(open_own(self._path, os.O_RDONLY), "rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size > LARGEST_FILE:
                raise ValueError(f"found {size / MIB:.4g} MiB; allowed: at most {LARGEST_FILE / MIB:g} MiB")
            if size < self._place:  # another journal
                self._place, self._cells = 0, {}
            file.seek(self._place)
            whole, end, _ = file.read(size - self._place).rpartition(b"\n")
        self._place += len(whole) + len(end)
        return whole.decode().split("\n") if end else []

    def _take(self, lines: Sequence[str]) -> None:
        rows = list(csv.reader(lines, strict=True))
        if rows and not self._cells:
            head, *rows = rows
            if missing := {"cost", "constraints_met", "rung"} - set(head):
                raise ValueError(f"no column {min(missing)}")
            self._cells = {name: [] for name in head}
        for row in rows:
            for cells, cell in zip(self._cells.values(), row, strict=True):
                cells.append(cell)

    def _evaluations(self) -> Evaluations:
        columns = self._cells or {"cost": [], "constraints_met": [], "rung": []}

        def figures(name: str) -> NDArray[np.float64]:
            return np.array(columns[name], dtype=np.float64)

        return Evaluations(
            cost=figures("cost"),
            speed_m_s=figures(SPEED.name) if SPEED.name in columns else np.full(len(columns["cost"]), np.nan),
            constraints_met=np.array([cell == "true" for cell in columns["constraints_met"]], dtype=np.bool_),
            working=np.array([cell == WORKING for cell in columns["rung"]], dtype=np.bool_),
            points={name.removeprefix(_POINT): figures(name) for name in columns if name.startswith(_POINT)},
        )


def read_evaluations(folder: Path) -> Evaluations:
    """Return the evaluations of a run folder; see `JournalReader.read`."""
    return JournalReader(folder).read()
