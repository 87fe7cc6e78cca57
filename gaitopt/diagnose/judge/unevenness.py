"""Whether the recorded cycles differ from one another more than those of any simulated robot.

Every effect of the library acts in the same way in each cycle. Gusts, a sticky patch of floor, a defective
servo or a supply that sometimes fails do not: they make cycles uneven. The covariance would treat this as a
robot that does not repeat itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.residual import WhitenedTrial, by_signal
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.floor import Floors, cycle_spread
from gaitopt.diagnose.judge.settings import VERDICT, VerdictSettings
from gaitopt.diagnose.record.cycles import steady_from

Array = NDArray[np.float64]

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
    squares = cycle_squares(trial_set, floors, comparisons)
    if squares is None:
        return 0.0
    recorded = np.maximum(0.0, squares.recorded - squares.noise)
    simulated = squares.simulated + settings.noise_error**2 * squares.noise + 1e-12
    return float(np.sqrt((recorded / simulated).max(initial=0.0)))


@dataclass(frozen=True)
class CycleSquares:
    """Mean squares by which cycles differ, m² or rad²: one for each signal of each trial, shape (n,).

    Attributes:
        recorded: of the recorded cycles; they include the noise.
        noise: of the recordings' noise.
        simulated: of simulated cycles.
    """

    recorded: Array
    noise: Array
    simulated: Array


def cycle_squares(
    trial_set: TrialSet, floors: Sequence[Floors], comparisons: Sequence[Comparison | None]
) -> CycleSquares | None:
    """Return by how much recorded and simulated cycles differ; None without any robot.

    Args:
        trial_set: the trials.
        floors: floor of each signal of each: what is recorded.
        comparisons: the trials compared with robots; None for those that failed.
    """
    known = [comparison for comparison in comparisons if comparison is not None]
    if not known:
        return None
    samples = [by_signal(trial_set.trials, one.marker, one.angles) for one in known]
    rows: list[tuple[float, float, float]] = []
    for index, one in enumerate(trial_set.trials):
        for name, floor in floors[index].items():
            if floor.spread is not None:
                spreads = [_spread(trial_set, one, name, parts[index][name]) for parts in samples]
                rows.append((floor.spread**2, floor.noise**2, float(np.mean(np.square(spreads)))))
    return CycleSquares(*np.array(rows).reshape(-1, 3).T)


def _spread(trial_set: TrialSet, one: WhitenedTrial, name: str, residual: NDArray[np.float64]) -> float:
    """Return how much the cycles of a predicted signal differ, m or rad; the trial's drive has a period."""
    trial = one.aligned.trial
    predicted = np.full(len(trial.time), np.nan)
    predicted[trial.used[name]] = trial.signals[name][trial.used[name]] - residual
    stand_in = replace(trial, signals={**trial.signals, name: predicted})
    transient = steady_from(trial_set.problem.simulation.horizon, trial.drive)
    return cycle_spread(replace(one.aligned, trial=stand_in), name, transient) or 0.0
