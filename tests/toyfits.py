"""Fits and benches without a simulator: effects that add a known direction to white rows."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from gaitopt.diagnose.fit.fitting import Comparison, Fit, TrialSet
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.effects.parts import ALL


def toy_bench(
    rows: int, count: int, views: Sequence[Any] = (), problem: Any = None, trials: int = 1
) -> TrialSet:
    """Rows in so many blocks of one trial, two folds of them; or of more trials, each a fold."""
    none, blocks = np.zeros(0, dtype=np.intp), np.repeat(np.arange(count), rows // count)
    folds = tuple(np.array_split(np.arange(count), max(2, trials)))
    of_trials = np.repeat(np.arange(trials), count // trials)
    return TrialSet(problem, None, tuple(views), (), blocks, of_trials, none, none, folds)


def toy_point(at: ArrayLike, whitened: np.ndarray) -> Comparison:
    return Comparison(np.asarray(at, dtype=float), whitened, np.empty(0), np.empty(0))


def toy_fit(
    trial_set: TrialSet,
    measured: np.ndarray,
    predicted: Callable[[float], np.ndarray],
    at: Sequence[float],
    name: str = "toy",
    target: str = ALL,
    high: float = 1.0,
) -> Fit:
    """The fit of an effect from 0 to so much, simulated here and there, that changes rows as predicted."""
    kind = "none" if target == ALL else "any"
    effect: Any = SimpleNamespace(
        name=name, target=kind, scale="lin", changes_robot=True, log_prior=lambda value, nominal: 0.0
    )
    hypothesis = Hypothesis(effect, target, 0.0, high, 0.0, cast(Any, None))
    points = [toy_point([a], measured - predicted(a)) for a in at]
    return Fit(hypothesis, trial_set, points)
