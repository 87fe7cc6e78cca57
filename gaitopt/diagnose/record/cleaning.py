"""A recording's defects one after another: each sees the trial as the one before left it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gaitopt.diagnose.record.clock import rounded_clock, stepped_clock
from gaitopt.diagnose.record.defects import Defect, Found, frozen, gaps, outliers
from gaitopt.diagnose.record.trial import Trial


@dataclass(frozen=True)
class Cleaned:
    """A trial once its defects are masked or corrected, as it was recorded, and what they were."""

    trial: Trial
    recorded: Trial
    defects: tuple[Defect, ...]


def clean(trial: Trial) -> Cleaned:
    """Find the defects that a recording shows by itself, and mask or correct them.

    What needs a period, such as excursions that recur in each cycle, is left out where the drive has none.
    """
    finders: tuple[Callable[[Trial], Found], ...] = (
        rounded_clock,
        stepped_clock,
        gaps,
        frozen,
        outliers,
    )
    recorded, defects = trial, []
    for find in finders:
        trial, defect = find(trial)
        if defect is not None:
            defects.append(defect)
    return Cleaned(trial, recorded, tuple(defects))
