"""Whether the recorded cycles differ from one another more than those of any simulated robot.

Every effect of the library acts alike in each cycle. What does not – gusts, a sticky stretch of floor, a
servo that limps, a supply that gives way now and then – makes cycles uneven, which the covariance would take
for a robot that does not repeat itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.fitting import Comparison, TrialSet
from gaitopt.diagnose.fit.residual import WhitenedTrial, by_signal
from gaitopt.diagnose.gap.floor import Floors, cycle_spread
from gaitopt.diagnose.record.cycles import steady_from

UNEVEN = 4.0
"""Cycles are uneven if they differ so many times as much as the simulated ones do."""

_NOISE = 0.3
"""Share of the measurement's noise by which its estimate may be off."""


def unevenness(trial_set: TrialSet, floors: Sequence[Floors], points: Sequence[Comparison | None]) -> float:
    """Return by how much the recorded cycles differ, in simulated differences; the largest of all signals.

    Args:
        trial_set: the trials.
        floors: floor of each signal of each: what is recorded.
        points: the trials beside robots of the sort that is to be judged; 0 is returned for none.
    """
    known = [point for point in points if point is not None]
    if not known:
        return 0.0
    ratios = []
    samples = [by_signal(trial_set.trials, point.marker, point.angles) for point in known]
    for index, one in enumerate(trial_set.trials):
        for name, floor in floors[index].items():
            if floor.spread is None:
                continue
            spreads = [_spread(trial_set, one, name, parts[index][name]) for parts in samples]
            recorded = max(0.0, floor.spread**2 - floor.noise**2)
            ratios.append(recorded / (np.mean(np.square(spreads)) + (_NOISE * floor.noise) ** 2 + 1e-12))
    return float(np.sqrt(max(ratios, default=0.0)))


def _spread(trial_set: TrialSet, one: WhitenedTrial, name: str, residual: NDArray[np.float64]) -> float:
    """Return how much the cycles of a predicted signal differ, m or rad; the trial's drive has a period."""
    trial = one.aligned.trial
    predicted = np.full(len(trial.time), np.nan)
    predicted[trial.used[name]] = trial.signals[name][trial.used[name]] - residual
    stand_in = replace(trial, signals={**trial.signals, name: predicted})
    transient = steady_from(trial_set.problem.simulation.horizon, trial.drive)
    return cycle_spread(replace(one.aligned, trial=stand_in), name, transient) or 0.0
