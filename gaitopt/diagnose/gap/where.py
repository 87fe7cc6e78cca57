"""Where the gap lies: its components by signal and trial, the largest first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Protocol

from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.gap.split import Split
from gaitopt.robot.signals import unit_of


@dataclass(frozen=True)
class GapShare:
    """One component of the gap of one signal of one trial.

    Attributes:
        signal: name of the signal.
        trial: name of the trial.
        component: one of `COMPONENTS`, or of `COMMAND_COMPONENTS` where the drive has no period.
        share: its share of the squared gaps of all trials that count, each in its floors.
        share_of_signal: its share of the squared gap of this signal in this trial.
        gap: RMS of the component, in `unit`.
        unit: ``m`` or ``rad``.
        floors: RMS of the component over the signal's floor; None where there is no floor.
    """

    signal: str
    trial: str
    component: str
    share: float
    share_of_signal: float
    gap: float
    unit: str
    floors: float | None

    def to_dict(self) -> dict[str, str | float | None]:
        """Return the row for a JSON file."""
        return asdict(self)


class SplitTrial(Protocol):
    """A trial whose gap is split; see `TrialGap`."""

    @property
    def name(self) -> str:
        """Name of the trial."""

    @property
    def splits(self) -> Mapping[str, Split]:
        """Gap of each signal by component."""

    @property
    def floors(self) -> Floors:
        """Floor of each signal."""


def gap_shares(trials: Sequence[SplitTrial]) -> list[GapShare]:
    """Return the components of the gaps of some trials, the largest share first, without those of size 0.

    Args:
        trials: the trials that count.
    """
    shares = [
        _gap_share(trial.name, trial.splits[signal], component, trial.floors[signal].total)
        for trial in trials
        for signal in trial.splits
        for component in trial.splits[signal].squares
    ]
    total = sum(one.share for one in shares) or 1.0
    present = [replace(one, share=one.share / total) for one in shares if one.gap > 0.0]
    return sorted(present, key=lambda one: -one.share)


@dataclass(frozen=True)
class ComponentShare:
    """One component of the gap of one signal over all trials.

    Attributes:
        signal: name of the signal.
        component: name of the component.
        share: its share of the squared gaps of all trials, each in its floors.
        gap: RMS of the component over the trials, in `unit`.
        unit: ``m`` or ``rad``.
        largest: its row in the trial where it is largest in floors.
    """

    signal: str
    component: str
    share: float
    gap: float
    unit: str
    largest: GapShare


def by_component(shares: Sequence[GapShare]) -> list[ComponentShare]:
    """Return the components of some gaps over all trials, the largest share first.

    Args:
        shares: components by trial, the largest share first; see `gap_shares`.
    """
    rows: dict[tuple[str, str], list[GapShare]] = {}
    for one in shares:
        rows.setdefault((one.signal, one.component), []).append(one)
    trials = {signal: len({one.trial for one in shares if one.signal == signal}) for signal, _ in rows}
    found = [
        ComponentShare(
            signal,
            component,
            sum(one.share for one in own),
            math.sqrt(sum(one.gap**2 for one in own) / trials[signal]),
            own[0].unit,
            own[0],
        )
        for (signal, component), own in rows.items()
    ]
    return sorted(found, key=lambda one: -one.share)


def _gap_share(trial: str, part: Split, component: str, floor: float) -> GapShare:
    """Return one component; its share is not yet divided by the sum of all."""
    rms = math.sqrt(part.squares[component])
    return GapShare(
        part.signal,
        trial,
        component,
        (rms / floor) ** 2 if floor > 0.0 else 0.0,
        part.squares[component] / (part.rms**2 or 1.0),
        rms,
        unit_of(part.signal),
        rms / floor if floor > 0.0 else None,
    )
