"""Replay: the evaluations of an interrupted search, in the order in which the search proposes them again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.optimise.journal import Entry, Journal


class Replay:
    """The entries that a journal held when the search was opened.

    A search proposes the same candidates in the same order whenever seed, budget and method are the same,
    and so each entry answers the candidate of its number.
    """

    def __init__(self, journal: Journal):
        self._path = journal.path
        self._entries = list(journal.entries)

    def answers(self, first: int, points: NDArray[np.float64], method: str, rung: str) -> list[Entry]:
        """Return the entries of the first candidates of a batch, as far as the journal has them.

        Args:
            first: number of the first candidate.
            points: the candidates, shape (n, d).
            method: who proposes them.
            rung: rung of the fidelity ladder on which they are judged.

        Raises:
            GaitoptError: an entry is of another candidate.
        """
        known = self._entries[first : first + len(points)]
        for entry, point in zip(known, points, strict=False):
            if (entry.method, entry.rung) != (method, rung) or not np.array_equal(entry.point, point):
                raise GaitoptError(
                    f"{self._path}: evaluation {entry.index} is not the one that this seed, budget "
                    "and method propose; the run was made by other ones or by another version"
                )
        return known

    def check_used(self, count: int) -> None:
        """Check that a search which is over has asked for every entry.

        Args:
            count: candidates of the search.

        Raises:
            GaitoptError: the journal has more.
        """
        if len(self._entries) > count:
            raise GaitoptError(
                f"{self._path}: found {len(self._entries)} evaluations; allowed: {count}, as many as this "
                "seed, budget and method propose"
            )
