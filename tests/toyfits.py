"""Fits and sets of trials without a simulator: effects that add a known direction to white rows."""

import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.effects.parts import ALL
from gaitopt.effects.prior import Prior


def toy_trials(
    rows: int,
    blocks: int,
    whitened: Sequence[WhitenedTrial] = (),
    channels: Sequence[str] = ("servo",),
    trials: int = 1,
) -> TrialSet:
    """Rows of one trial in two folds, or of several trials with one fold each."""
    none, of_rows = np.zeros(0, dtype=np.intp), np.repeat(np.arange(blocks), rows // blocks)
    folds = tuple(np.array_split(np.arange(blocks), max(2, trials)))
    of_trials = np.repeat(np.arange(trials), blocks // trials)
    simulator: Any = SimpleNamespace(problem=SimpleNamespace(channel_names=tuple(channels)))
    return TrialSet(simulator, tuple(whitened), (), of_rows, of_trials, none, none, none, folds)


def toy_comparison(at: ArrayLike, whitened: np.ndarray) -> Comparison:
    """A robot with a given whitened residual, and no samples."""
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
    """The fit of an effect from 0 to `high`, simulated at some coordinates."""
    kind = "none" if target == ALL else "any"
    effect: Any = SimpleNamespace(
        name=name,
        target=kind,
        scale="lin",
        parameter="size",
        changes_robot=True,
        prior_on=lambda nominal: (Prior("normal", 0.0, math.inf, "anything goes"), 1.0),
    )
    nominal: Any = SimpleNamespace(channels=trial_set.problem.channel_names)
    hypothesis = Hypothesis(effect, target, 0.0, high, 0.0, nominal)
    return Fit(hypothesis, trial_set, [toy_comparison([a], measured - predicted(a)) for a in at])
