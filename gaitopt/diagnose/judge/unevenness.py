"""Whether the recorded cycles differ from one another more than those of any simulated robot.

Every effect of the library acts in the same way in each cycle. Gusts, a sticky patch of floor, a defective
servo or a supply that sometimes fails do not: they make cycles uneven. The covariance would treat this as a
robot that does not repeat itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.residual import WhitenedTrial, by_signal
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.floor import Floors, cycle_spread
from gaitopt.diagnose.judge.settings import VERDICT, VerdictSettings
from gaitopt.diagnose.record.cycles import steady_from

UNEVEN = VerdictSettings.uneven
"""Ratio of recorded to simulated differences between cycles from which cycles are uneven."""


def unevenness(
    trial_set: TrialSet,
    floors: Sequence[Floors],
    comparisons: Sequence[Comparison | None],
    settings: VerdictSettings = VERDICT,
) -> float:
    """Return by how much the recorded cycles differ, in simulated differences; the largest of all signals.

    Args:
        trial_set: the trials.
        floors: floor of each signal of each: what is recorded.
        comparisons: the trials compared with perturbed robots; None for those that failed. Without any, 0 is
            returned.
        settings: error of the noise.
    """
    known = [comparison for comparison in comparisons if comparison is not None]
    if not known:
        return 0.0
    ratios = []
    samples = [by_signal(trial_set.trials, one.marker, one.angles) for one in known]
    for index, one in enumerate(trial_set.trials):
        for name, floor in floors[index].items():
            if floor.spread is None:
                continue
            spreads = [_spread(trial_set, one, name, parts[index][name]) for parts in samples]
            recorded = max(0.0, floor.spread**2 - floor.noise**2)
            simulated = np.mean(np.square(spreads)) + (settings.noise_error * floor.noise) ** 2 + 1e-12
            ratios.append(recorded / simulated)
    return float(np.sqrt(max(ratios, default=0.0)))


def _spread(trial_set: TrialSet, one: WhitenedTrial, name: str, residual: NDArray[np.float64]) -> float:
    """Return how much the cycles of a predicted signal differ, m or rad; the trial's drive has a period."""
    trial = one.aligned.trial
    predicted = np.full(len(trial.time), np.nan)
    predicted[trial.used[name]] = trial.signals[name][trial.used[name]] - residual
    stand_in = replace(trial, signals={**trial.signals, name: predicted})
    transient = steady_from(trial_set.problem.simulation.horizon, trial.drive)
    return cycle_spread(replace(one.aligned, trial=stand_in), name, transient) or 0.0
