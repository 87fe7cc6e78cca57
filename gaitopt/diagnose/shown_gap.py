"""The gap that a diagnosis puts into words, and lengths and angles in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.judge.gap import Gap


@dataclass(frozen=True)
class ShownGap:
    """The gap that is put into words: the marker's, or that of the angles where no marker was measured.

    Attributes:
        gap: the gap, m or rad.
        of: what it is the gap of.
        amount: returns a length or an angle in words.
        in_rad: whether it is an angle.
    """

    gap: Gap
    of: str
    amount: Callable[[float], str]
    in_rad: bool = False

    @property
    def in_words(self) -> str:
        """The gap on held-out data."""
        gap = self.gap
        before, after, floor = map(self.amount, (gap.before, gap.after, gap.floor))
        share = gap.shrinkage
        shrinks = "" if share is None else f", which removes {share:.0%} of what is above the floor"
        if share is not None and gap.after <= gap.floor:
            shrinks = ", which is within the floor"
        return f"{before} RMS of {self.of} before, {after} after on held-out trials{shrinks}; floor {floor}"


def shown_gap(diagnosis: Diagnosis) -> ShownGap:
    """Return the gap that is put into words: with the correction, where no effect is blamed."""
    found, correction = diagnosis.found, diagnosis.correction
    corrected = diagnosis.gap_with(correction) if found and correction and not found.causes else None
    angles = None if diagnosis.measures_positions else diagnosis.gap_angles
    if angles is None:
        return ShownGap(corrected or diagnosis.gap, "the marker", millimetres)
    return ShownGap(corrected or angles, "the angles", angle, in_rad=True)


def angle(value: float) -> str:
    """Return an angle, rad, in words; no finer than sensors are."""
    degrees = math.degrees(value)
    rad = f"{value:.3g}" if abs(value) >= 0.01 else f"{value:.4f}"
    return f"{rad} rad ({degrees:.3g}°)" if abs(degrees) >= 1.0 else f"{rad} rad ({degrees:.2f}°)"


def millimetres(value: float) -> str:
    """Return a length, m, in words."""
    return f"{1e3 * value:.3g} mm"
