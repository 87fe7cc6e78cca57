"""The beginnings of trials: most effects show themselves there, at a fraction of the simulated time."""

from __future__ import annotations

from dataclasses import dataclass

from gaitopt.diagnose.fit.settings import FitSettings
from gaitopt.diagnose.fit.trials import Comparison, TrialSet


@dataclass(frozen=True)
class Head:
    """The beginnings of trials, where they show the gap.

    Attributes:
        trial_set: the beginnings.
        nominal: these compared with the nominal robot.
        clear: whether the gap is so large there that sets of effects may be searched in them, too. A faint
            gap tells no more than which effects alone are worth whole trials.
    """

    trial_set: TrialSet
    nominal: Comparison
    clear: bool


def head_of(trial_set: TrialSet, settings: FitSettings) -> Head | None:
    """Return the beginnings of trials; None where they are not much shorter, or do not show the gap."""
    head = trial_set.head(settings.head_s)
    if _simulated_s(head) > settings.head_share * _simulated_s(trial_set):
        return None
    nominal = head.compare([0.0], head.nominal)
    if nominal is None:
        return None
    squares = nominal.whitened**2
    if float(squares.sum()) - len(squares) < settings.shown:
        return None
    return Head(head, nominal, clear=float(squares.mean()) >= settings.visible)


def _simulated_s(trial_set: TrialSet) -> float:
    return sum(run.duration_s for run in trial_set.runs.values())
