"""Progress of a job, for display."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One step of a job.

    Attributes:
        stage: the current work, in words.
        done: how much of it is done, in `unit`.
        total: how much of it there is; None where that is not known.
        unit: what is counted.
    """

    stage: str
    done: int = 0
    total: int | None = None
    unit: str = ""


OnProgress = Callable[[Progress], None]
"""Called with each step of a job."""


def silent(progress: Progress) -> None:
    """Show nothing."""
