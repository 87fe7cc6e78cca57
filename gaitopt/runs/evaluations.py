"""``evaluations.csv`` as a reader sees it: figures of each gait, while the run goes on, too.

Nothing is checked by its digest and nothing is written here; a search that goes on reads its journal by
`optimise.journal`.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_bytes
from gaitopt.core.own_files import check_own
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
    def best(self) -> int | None:
        """Index of the lowest cost at the working fidelity, the earliest of equals; None without any."""
        if not self.working.any():
            return None
        return int(np.argmin(np.where(self.working, self.cost, np.inf)))


def read_evaluations(folder: Path) -> Evaluations:
    """Return the evaluations of a run folder. A last row that is not written to its end is left out.

    Raises:
        GaitoptError: the file is missing, no plain file of the folder, or no journal.
    """
    path = folder / JOURNAL_FILE
    if not check_own(path):
        raise GaitoptError(f"{path}: no such file")
    whole = read_bytes(path).rpartition(b"\n")[0]
    try:
        head, *rows = list(csv.reader(whole.decode().splitlines(), strict=True)) or [[]]
        return _evaluations(head, rows)
    except (ValueError, csv.Error) as error:
        raise GaitoptError(f"{path}: not the journal of a run: {shortened(str(error), 200)}") from None


def _evaluations(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Evaluations:
    columns = dict(zip(head, zip(*rows, strict=True), strict=True)) if rows else dict.fromkeys(head, ())
    if missing := {"cost", "constraints_met", "rung"} - set(columns):
        raise ValueError(f"no column {min(missing)}")

    def figures(name: str) -> NDArray[np.float64]:
        return np.array(columns[name], dtype=np.float64)

    return Evaluations(
        cost=figures("cost"),
        speed_m_s=figures(SPEED.name) if SPEED.name in columns else np.full(len(rows), np.nan),
        constraints_met=np.array([cell == "true" for cell in columns["constraints_met"]], dtype=np.bool_),
        working=np.array([cell == WORKING for cell in columns["rung"]], dtype=np.bool_),
        points={name.removeprefix(_POINT): figures(name) for name in head if name.startswith(_POINT)},
    )
