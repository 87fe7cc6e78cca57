"""One trial aligned with the nominal prediction: its gap, its floors, and the defects of its recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from gaitopt.diagnose.gap.align import Aligned, unlike
from gaitopt.diagnose.gap.floor import Floor, Floors, above_floor, floors_off, marker_floor
from gaitopt.diagnose.gap.leftover import TopSpeeds
from gaitopt.diagnose.gap.misfits import MISFITS
from gaitopt.diagnose.gap.mismatches import mismatches
from gaitopt.diagnose.gap.settings import DEFAULT, GapSettings
from gaitopt.diagnose.gap.split import COMPONENTS, Split, split
from gaitopt.diagnose.gap.split_commands import split_commands
from gaitopt.diagnose.record.cleaning import Cleaned
from gaitopt.diagnose.record.cycles import steady_from
from gaitopt.diagnose.record.defect import Defect
from gaitopt.effects import EFFECTS
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import unit_of

SIGNIFICANT = 2.0
"""A gap of this many floors is significant: the gap of a correct model is below it in 95 of 100 cases."""


@dataclass(frozen=True)
class SignalGap:
    """The gap of one signal of one trial.

    Attributes:
        signal: name of the signal.
        gap: RMS distance of measured and predicted, in `unit`.
        floor: why a correct model does not fit better.
        split: the gap by component.
    """

    signal: str
    gap: float
    floor: Floor
    split: Split

    @property
    def unit(self) -> str:
        """Unit of the signal, ``m`` or ``rad``."""
        return unit_of(self.signal)

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``signals`` of a trial in ``diagnosis.json``."""
        measured, simulated = self.split.travel or (None, None)
        return {
            "signal": self.signal,
            "unit": self.unit,
            "gap": self.gap,
            "floor": self.floor.total,
            "floor_parts": self.floor.to_dict(),
            "travel_measured": measured,
            "travel_simulated": simulated,
            "size_ratio": self.split.size,
            "delay_s": self.split.delay_s,
            "by_phase": self.split.by_phase.tolist(),
            "shares": self.split.shares,
        }


@dataclass(frozen=True)
class TrialGap:
    """One trial beside the nominal prediction.

    Attributes:
        cleaned: the trial as recorded and as used, with the record's own defects.
        aligned: the cleaned trial, aligned with the nominal prediction.
        floors: floor of each signal.
        splits: the gap of each signal by component, with what defects of the record put into it.
        mismatches: defects seen only in comparison with the prediction.
    """

    cleaned: Cleaned
    aligned: Aligned
    floors: Floors
    splits: Mapping[str, Split]
    mismatches: tuple[Defect, ...]

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.aligned.trial.name

    @property
    def has_log(self) -> bool:
        """Whether what was commanded has no period."""
        return self.aligned.trial.has_log

    @property
    def defects(self) -> tuple[Defect, ...]:
        """All defects of the record."""
        return self.cleaned.defects + self.mismatches

    def with_mismatches(self, defects: Sequence[Defect]) -> TrialGap:
        """Return the same with more defects that are seen only in comparison with predictions."""
        return replace(self, mismatches=(*defects, *self.mismatches))

    @property
    def is_misfit(self) -> bool:
        """Whether it cannot be a recording of the gait that it names."""
        return any(defect.name in MISFITS for defect in self.mismatches)

    @property
    def unlike(self) -> float:
        """Mean squared difference of measured and predicted signals, in variances of the measured ones."""
        return unlike(self.aligned.trial, self.aligned.simulated, self.aligned.offset_s)

    @property
    def ratios(self) -> dict[str, float]:
        """Gap over floor, of the marker and of each angle."""
        return floors_off(self.aligned, self.floors)

    @property
    def counts(self) -> bool:
        """Whether the trial can show a cause: a gap, cleaned or as recorded, above the floor."""
        return above_floor(self.aligned, self.floors) or bool(self.blamed)

    @property
    def significant(self) -> bool:
        """Whether a gap is left, once defects are masked, that the floor does not explain."""
        return max(self.ratios.values()) > SIGNIFICANT

    @property
    def blamed(self) -> list[Defect]:
        """Defects whose error alone exceeds the marker's floor."""
        floor = marker_floor(self.floors)
        causes = [d for d in self.cleaned.defects if d.name in EFFECTS and EFFECTS[d.name].found_in_record]
        return [defect for defect in causes if defect.error_m > floor]

    @property
    def signals(self) -> list[SignalGap]:
        """The gap of each signal."""
        return [
            SignalGap(name, self.aligned.rms(name), floor, self.splits[name])
            for name, floor in self.floors.items()
        ]

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``trials`` in ``diagnosis.json``."""
        aligned = self.aligned
        return {
            "name": self.name,
            "gait": aligned.trial.drive.name,
            "period_s": aligned.trial.drive.period_s,
            "offset_s": aligned.offset_s,
            "offset_fitted": aligned.trial.starts_at_s is None,
            "marker_gap_m": aligned.marker_rms,
            "marker_floor_m": marker_floor(self.floors),
            "gap_over_floor": self.ratios,
            "significant": self.significant,
            "counts": self.counts,
            "signals": [signal.to_dict() for signal in self.signals],
        }


def trial_gap(
    problem: Problem,
    cleaned: Cleaned,
    aligned: Aligned,
    floors: Floors,
    speeds: TopSpeeds | None = None,
    settings: GapSettings = DEFAULT,
) -> TrialGap:
    """Split the gap of a trial, and look for defects that only the prediction shows.

    Args:
        problem: the nominal problem.
        cleaned: the trial with the defects of its record.
        aligned: the same, aligned with the nominal prediction.
        floors: the floor of each signal.
        speeds: how quick each signal is in all trials of the data set; those of this trial if it is None.
        settings: see `GapSettings`.
    """
    transient = steady_from(problem.simulation.horizon, aligned.trial.drive)
    splits = {}
    for name in aligned.trial.signals:
        extra = dict.fromkeys(COMPONENTS, 0.0)
        for defect in cleaned.defects:
            if defect.component is not None:
                extra[defect.component] += defect.errors_m.get(name, 0.0) ** 2
        if aligned.trial.has_log:
            splits[name] = split_commands(
                aligned, name, floors[name].noise, extra, speeds, settings.split_commands
            )
        else:
            splits[name] = split(aligned, name, transient, extra, settings.split)
    wrong = mismatches(aligned, transient, settings.mismatches)
    return TrialGap(cleaned, aligned, floors, splits, tuple(wrong))
