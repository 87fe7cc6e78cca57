"""The journal: every evaluation of a search, on disk as soon as its batch is done."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_bytes
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.objective import Evaluation

WORKING = "working"
"""The rung of what was judged at the problem's working fidelity."""


@dataclass(frozen=True)
class Entry:
    """One evaluated gait.

    Costs of different rungs are of different robots: only those of one rung may be compared.

    Attributes:
        index: number of the candidate.
        method: who proposed it: a solver, ``plan``, ``quasi-random`` or ``pareto``.
        point: its coordinates in the gait space, shape (d,).
        gait: the gait.
        evaluation: what it is worth.
        simulated_s: simulated seconds that it took.
        rung: the rung of the fidelity ladder that judged it.
    """

    index: int
    method: str
    point: NDArray[np.float64]
    gait: Gait
    evaluation: Evaluation
    simulated_s: float
    rung: str = WORKING


def at_rung(entries: Iterable[Entry], rung: str = WORKING) -> list[Entry]:
    """Return the entries that were judged on one rung of the fidelity ladder."""
    return [entry for entry in entries if entry.rung == rung]


def ranked(entries: Iterable[Entry]) -> list[Entry]:
    """Return entries of one rung, the lowest cost first, the earliest of equals."""
    return sorted(entries, key=lambda entry: (entry.evaluation.cost, entry.index))


class Journal:
    """``evaluations.csv``: one row per gait in candidate order, floats that round-trip.

    A torn last line, as a killed process leaves it, is dropped. A search that is opened on a journal with
    rows goes on after them (see `replay`).

    Attributes:
        path: the file.
        columns: names of its columns.
        entries: the evaluations.
    """

    def __init__(self, path: Path, problem: Problem):
        self.path = path
        self._space = problem.space
        self._variables = [variable.name for variable in problem.space.variables]
        self._metrics = metric_names(problem)
        self._constraints = list(problem.objective.constraints)
        self.columns = [
            *("evaluation", "method", "cost", "status", "constraints_met", "simulated_s", "rung"),
            *self._metrics,
            *(f"violation.{name}" for name in self._constraints),
            *(f"x.{name}" for name in self._variables),
            *("period_s", *gait_columns(problem)),
        ]
        self.entries: list[Entry] = []
        if not (path.exists() and self._read()):
            self._write([self.columns], os.O_CREAT | os.O_TRUNC)

    def append(self, entries: Sequence[Entry]) -> None:
        """Add the entries of one batch and make sure that they are on the disk."""
        self._write([self._row(entry) for entry in entries], os.O_APPEND)
        self.entries.extend(entries)

    def _row(self, entry: Entry) -> list[str]:
        evaluation = entry.evaluation
        cells = [str(entry.index), entry.method, repr(evaluation.cost), evaluation.status.replace("\n", " ")]
        cells += [str(evaluation.constraints_met).lower(), repr(entry.simulated_s), entry.rung]
        cells += [repr(evaluation.metrics[name]) for name in self._metrics]
        cells += [repr(evaluation.violations.get(name, 0.0)) for name in self._constraints]
        cells += [repr(value) for value in entry.point.tolist()]
        cells.append(repr(entry.gait.period_s))
        for channel in entry.gait.channels.values():
            cells += [repr(value) for value in channel.model_dump().values()]
        return cells

    def _write(self, rows: Sequence[Sequence[str]], flags: int) -> None:
        """Write to the disk. Without ``O_CREAT``, rows never go to a new file if the journal was removed."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        try:
            with os.fdopen(os.open(self.path, os.O_WRONLY | flags, 0o644), "wb") as file:
                file.write(text.getvalue().encode())
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise GaitoptError(f"{self.path}: cannot be written: {error.strerror}") from None

    def _read(self) -> bool:
        """Read the rows that are there; False when not even the header is whole."""
        content = read_bytes(self.path)
        whole = content[: content.rfind(b"\n") + 1]
        rows = list(csv.reader(self._decoded(whole).splitlines()))
        if not rows:
            return False
        if rows[0] != self.columns:
            raise GaitoptError(
                f"{self.path}: columns are not those of this problem and version; cannot resume"
            )
        for number, row in enumerate(rows[1:]):
            if len(row) != len(self.columns):
                raise GaitoptError(
                    f"{self.path}: line {number + 2}: {len(row)} cells, not {len(self.columns)}"
                )
            try:
                self.entries.append(self._entry(dict(zip(self.columns, row, strict=True))))
            except ValueError as error:
                raise GaitoptError(f"{self.path}: line {number + 2}: {error}") from None
        if whole != content:
            self._cut(len(whole))
        return True

    def _decoded(self, content: bytes) -> str:
        try:
            return content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise GaitoptError(f"{self.path}: not UTF-8 text (byte {error.start})") from None

    def _cut(self, length: int) -> None:
        """Drop a torn end; the rest of the file is on the disk at every moment."""
        try:
            os.truncate(self.path, length)
        except OSError as error:
            raise GaitoptError(f"{self.path}: cannot be written: {error.strerror}") from None

    def _entry(self, row: dict[str, str]) -> Entry:
        metrics = {name: float(row[name]) for name in self._metrics}
        violations = {name: float(row[f"violation.{name}"]) for name in self._constraints}
        evaluation = Evaluation(float(row["cost"]), metrics, violations, row["status"])
        point = np.array([float(row[f"x.{name}"]) for name in self._variables])
        if not np.isfinite(point).all():
            raise ValueError("a coordinate that is not a number")
        gait, simulated_s = self._space.decode(point), float(row["simulated_s"])
        return Entry(int(row["evaluation"]), row["method"], point, gait, evaluation, simulated_s, row["rung"])


def gait_columns(problem: Problem) -> list[str]:
    """Return the names of a gait's numbers, channel by channel."""
    keys = ("duty", "phase", "amplitude_deg", "offset_deg", "smoothing")
    return [f"{name}.{key}" for name in problem.channel_names for key in keys]
