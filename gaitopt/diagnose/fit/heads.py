"""The beginnings of trials: most effects show themselves there, at a fraction of the simulated time."""

from __future__ import annotations

from gaitopt.diagnose.fit.settings import FitSettings
from gaitopt.diagnose.fit.trials import Comparison, TrialSet


def head_of(trial_set: TrialSet, settings: FitSettings) -> tuple[TrialSet, Comparison] | None:
    """Return the beginnings of trials, and these compared with the nominal robot.

    Returns:
        None where they are not much shorter than the trials, or do not show the gap.
    """
    head = trial_set.head(settings.head_s)
    if _simulated_s(head) > settings.head_share * _simulated_s(trial_set):
        return None
    nominal = head.compare([0.0], head.nominal)
    if nominal is None or float((nominal.whitened**2).mean()) < settings.visible:
        return None
    return head, nominal


def _simulated_s(trial_set: TrialSet) -> float:
    return sum(run.duration_s for run in trial_set.runs.values())
