"""The journal: every evaluation of a search, on disk as soon as its batch is done."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_bytes
from gaitopt.core.own_files import check_own, open_own
from gaitopt.core.text import shortened
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.objective import Evaluation

WORKING = "working"
"""The rung of what was judged at the problem's working fidelity."""

DIGEST = "digest"
"""The last column of a journal."""

_LONGEST_ERROR = 300
"""Most characters that are quoted of what is wrong in a row."""


@dataclass(frozen=True)
class Entry:
    """One evaluated gait.

    Costs of different rungs are of different robots: only those of one rung may be compared.

    Attributes:
        index: number of the candidate.
        method: who proposed it: a solver, ``plan``, ``near-plan``, ``quasi-random`` or ``pareto``.
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


def succeeded(entries: Iterable[Entry], rung: str = WORKING) -> list[Entry]:
    """Return the entries of one rung in which no simulation failed, the lowest cost first."""
    return [entry for entry in ranked(at_rung(entries, rung)) if entry.evaluation.status == "ok"]


class Journal:
    """``evaluations.csv``: one row per gait in candidate order, floats that round-trip.

    A torn last line, as a killed process leaves it, is dropped. A search that is opened on a journal with
    rows goes on after them (see `replay`).

    Each row ends with a digest of itself and of the digest before it; the first digest before a row is that
    of the key and the header. So a row that was changed, added, removed or moved since shows, and so does
    another problem or request. It is no signature: who writes new digests, too, is believed.

    Attributes:
        path: the file.
        columns: names of its columns.
        entries: the evaluations.
    """

    def __init__(self, path: Path, problem: Problem, key: str = ""):
        """Open a journal, or begin one.

        Args:
            path: the file.
            problem: the problem.
            key: what the evaluations depend on: the problem, the request and the versions, in any form.

        Raises:
            GaitoptError: the file is not a journal of this problem, was changed since, or cannot be written.
        """
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
            DIGEST,
        ]
        self.entries: list[Entry] = []
        self._digest = _digest(key, _line(self.columns))
        if not (check_own(path) and self._read()):
            self._write(_line(self.columns) + b"\n", os.O_CREAT)

    def append(self, entries: Sequence[Entry]) -> None:
        """Add the entries of one batch and make sure that they are on the disk."""
        lines, digest = [], self._digest
        for entry in entries:
            line = _line(self._cells(entry))
            digest = _digest(digest, line)
            lines.append(line + b"," + digest.encode() + b"\n")
        self._write(b"".join(lines), os.O_APPEND)
        self._digest = digest
        self.entries.extend(entries)

    def _cells(self, entry: Entry) -> list[str]:
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

    def _write(self, data: bytes, flags: int) -> None:
        """Write to the disk. Without ``O_CREAT``, rows never go to a new file if the journal was removed."""
        try:
            with os.fdopen(open_own(self.path, os.O_WRONLY | flags), "wb") as file:
                if flags & os.O_CREAT:
                    file.truncate(0)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise GaitoptError(f"{self.path}: cannot be written: {error.strerror}") from None

    def _read(self) -> bool:
        """Read the rows that are there; False when not even the header is whole."""
        content = read_bytes(self.path)
        header, *lines, torn = (_line(self.columns), *content.split(b"\n"))
        if not lines and header.startswith(torn):
            return False
        if not lines or lines[0] != header:
            old = lines[:1] == [header.removesuffix(f",{DIGEST}".encode())]
            raise GaitoptError(
                f"{self.path}: no column {DIGEST}: the run is of an earlier version; cannot resume"
                if old
                else f"{self.path}: columns are not those of this problem and version; cannot resume"
            )
        for number, line in enumerate(lines[1:], 2):
            try:
                self.entries.append(self._checked(line))
            except (ValueError, csv.Error) as error:
                text = shortened(str(error), _LONGEST_ERROR)
                raise GaitoptError(f"{self.path}: line {number}: {text}") from None
        if torn:
            self._cut(len(content) - len(torn))
        return True

    def _checked(self, line: bytes) -> Entry:
        """Return the evaluation of a line, and go on to the next line.

        Raises:
            ValueError: the line is not what was written after the line before, or is no evaluation.
        """
        row, _, said = line.rpartition(b",")
        digest = _digest(self._digest, row)
        if said != digest.encode():
            raise ValueError(
                f"its {DIGEST} is not that of this row after the rows before it: the journal, or the problem "
                "or request beside it, was changed since; cannot resume"
            )
        cells = next(csv.reader([row.decode()], strict=True))
        if len(cells) != len(self.columns) - 1:
            raise ValueError(f"{len(cells) + 1} cells, not {len(self.columns)}")
        entry = self._entry(dict(zip(self.columns[:-1], cells, strict=True)))
        if entry.index != len(self.entries):
            raise ValueError(f"evaluation: found {entry.index}; allowed: {len(self.entries)}")
        if self._cells(entry) != cells:
            raise ValueError("its numbers do not belong together, or are not as gaitopt writes them")
        self._digest = digest
        return entry

    def _cut(self, length: int) -> None:
        """Drop a torn end; the rest of the file is on the disk at every moment."""
        try:
            with os.fdopen(open_own(self.path, os.O_WRONLY), "wb") as file:
                file.truncate(length)
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
        if not (math.isfinite(evaluation.cost) and math.isfinite(simulated_s)):
            raise ValueError("a cost or a simulated time that is not a number")
        return Entry(int(row["evaluation"]), row["method"], point, gait, evaluation, simulated_s, row["rung"])


def _line(cells: Sequence[str]) -> bytes:
    """Return a line of the table, without its end."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(cells)
    return text.getvalue().encode()


def _digest(before: str, line: bytes) -> str:
    return hashlib.sha256(before.encode() + b"\n" + line).hexdigest()[:16]


def gait_columns(problem: Problem) -> list[str]:
    """Return the names of a gait's numbers, channel by channel."""
    keys = ("duty", "phase", "amplitude_deg", "offset_deg", "smoothing")
    return [f"{name}.{key}" for name in problem.channel_names for key in keys]
