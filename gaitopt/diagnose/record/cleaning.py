"""Defects that a recording shows by itself: each is found, and its samples are masked or corrected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gaitopt.diagnose.record.angles import coarse_angles, wrapped_angles
from gaitopt.diagnose.record.clock import doubled_stamps, rounded_clock
from gaitopt.diagnose.record.commands import commands_beyond_range
from gaitopt.diagnose.record.defect import Defect, Found
from gaitopt.diagnose.record.frames import frozen, gaps
from gaitopt.diagnose.record.outliers import outliers
from gaitopt.diagnose.record.settings import DEFAULT, DefectSettings
from gaitopt.diagnose.record.stepped_curve import stepped_curve
from gaitopt.diagnose.record.stuck import stuck_angles
from gaitopt.diagnose.record.trial import Trial

FINDERS: tuple[Callable[[Trial, DefectSettings], Found], ...] = (
    rounded_clock,
    doubled_stamps,
    stepped_curve,
    gaps,
    frozen,
    wrapped_angles,
    stuck_angles,
    coarse_angles,
    outliers,
    commands_beyond_range,
)
"""One function for each defect, in the order in which they run. Each gets the trial from the one before."""


@dataclass(frozen=True)
class Cleaned:
    """A trial after cleaning.

    Attributes:
        trial: the trial, its defects masked or corrected.
        recorded: the trial as it was recorded.
        defects: what was wrong. Each lists the samples that were masked or the stamps that were corrected.
    """

    trial: Trial
    recorded: Trial
    defects: tuple[Defect, ...]


def clean(trial: Trial, settings: DefectSettings = DEFAULT) -> Cleaned:
    """Find the defects that a recording shows by itself, and mask or correct them.

    What needs a period, such as excursions that recur in each cycle, is left out where the drive has none.

    Args:
        trial: the recording.
        settings: see `DefectSettings`.
    """
    recorded, defects = trial, []
    for find in FINDERS:
        trial, defect = find(trial, settings)
        if defect is not None:
            defects.append(defect)
    return Cleaned(trial, recorded, tuple(defects))
