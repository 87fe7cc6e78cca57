"""Progress of a job, for display."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Progress:
    """One step of a job.

    Attributes:
        stage: the current work, in words.
        done: how much of it is done, in `unit`.
        total: how much of it there is; None where that is not known.
        unit: what is counted.
        number: number of the stage, from 1; 0 where stages are not counted.
        stages: number of stages of the job.
    """

    stage: str
    done: int = 0
    total: int | None = None
    unit: str = ""
    number: int = 0
    stages: int = 0


OnProgress = Callable[[Progress], None]
"""Called with each step of a job."""


def silent(progress: Progress) -> None:
    """Show nothing."""


def numbered(on_progress: OnProgress, stages: Sequence[str]) -> OnProgress:
    """Return what tells progress on, with the number of each stage among all that the job has."""
    numbers = {name: number for number, name in enumerate(stages, 1)}

    def tell(step: Progress) -> None:
        if step.stage in numbers:
            step = replace(step, number=numbers[step.stage], stages=len(stages))
        on_progress(step)

    return tell


class Count:
    """Counts what is done of a stage, and tells it."""

    def __init__(self, on_progress: OnProgress, stage: str, total: int | None, unit: str):
        self.stage = stage
        self._on_progress = on_progress
        self._step = Progress(stage, 0, total, unit)
        on_progress(self._step)

    def one(self) -> None:
        """Count one more."""
        self._step = replace(self._step, done=self._step.done + 1)
        self._on_progress(self._step)
