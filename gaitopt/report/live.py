"""The page of a run that goes on, and what it asks for again and again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.report.page import rendered
from gaitopt.runs.evaluations import Evaluations, JournalReader
from gaitopt.runs.folder import JOURNAL_FILE

LIVE_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; "
    "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
"""What a browser may load for the page: what is in it, and the figures of this run."""

EVERY_S = 2.0
"""Seconds after which the page asks again."""

_MOST_POINTS = 600
"""Most gaits that are drawn; the improvements are all drawn."""


@dataclass(frozen=True)
class Watched:
    """The run that is watched.

    Attributes:
        folder: its folder.
        problem: name of its problem.
        budget: gaits that it will evaluate.
        seed: its seed.
    """

    folder: Path
    problem: str
    budget: int
    seed: int


def live_page(run: Watched) -> str:
    """Return the page."""
    return rendered("live.html", run=run, every_ms=1000.0 * EVERY_S, styles=["page.css", "live.css"])


class LiveFigures:
    """What the page shows: made anew only when the journal has grown."""

    def __init__(self, run: Watched, state: Callable[[], str]):
        """Begin.

        Args:
            run: the run.
            state: says whether it is ``running``, ``finished`` or ``interrupted``.
        """
        self._run, self._state = run, state
        self._reader = JournalReader(run.folder)
        self._size = -1
        self._figures: dict[str, object] = {"evaluations": 0, "best": None, "gaits": [], "improvements": []}

    def json(self) -> bytes:
        """Return the figures now; what cannot be read at this moment stays as it was."""
        try:
            size = (self._run.folder / JOURNAL_FILE).lstat().st_size
            if size != self._size:
                self._figures, self._size = _figures(self._reader.read()), size
        except (GaitoptError, OSError):
            pass  # a journal that is not begun, or is written at this moment: the next question gets it
        return to_json({"state": self._state(), "budget": self._run.budget} | self._figures).encode()


def _figures(done: Evaluations) -> dict[str, object]:
    better = done.improvements
    drawn = np.unique(np.linspace(0, len(done) - 1, min(len(done), _MOST_POINTS)).astype(int))
    return {
        "evaluations": len(done),
        "best": _gait(done, int(better[-1])) if len(better) else None,
        "gaits": [_gait(done, int(index)) for index in drawn],
        "improvements": [_gait(done, int(index)) for index in better],
    }


def _gait(done: Evaluations, index: int) -> dict[str, object]:
    """Return a gait's number, counted from 1, and its speed, mm/s; None where it has none."""
    speed = done.speed_m_s[index]
    return {
        "gait": index + 1,
        "speed_mm_s": round(1e3 * float(speed), 3) if np.isfinite(speed) else None,
        "limits_kept": bool(done.constraints_met[index]),
        "working": bool(done.working[index]),
    }
