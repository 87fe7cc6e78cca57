"""How well a parameter is known: intervals cover the truth, and are wide where the loss is flat."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from toyfits import toy_fit, toy_trials

from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.precision import Precision

ROWS, TRUE = 60, 0.9


def fitted(measured: np.ndarray, predicted: Callable[[float], np.ndarray], at: Sequence[float]) -> Candidate:
    """The candidate of one parameter between 0 and 2, simulated at some coordinates."""
    fit = toy_fit(toy_trials(ROWS, 6), measured, predicted, at, high=2.0)
    loss = fit.loss()
    return Candidate(
        (fit.hypothesis,),
        (fit.best(),),
        loss,
        loss,
        fit.at_best("whitened"),
        np.empty(0),
        np.empty(0),
        fit,
    )


@pytest.mark.parametrize("size", [0.0, 10.0])
def test_nine_in_ten_intervals_cover_whatever_the_small_errors_of_the_robot(size: float) -> None:
    """Intervals are too wide for noise alone, because its squares have a weight below one."""
    rng = np.random.default_rng(5)
    slope, hidden = rng.standard_normal(ROWS) * 8.0, rng.standard_normal((4, ROWS)) / 2.0
    covered = 0
    for _ in range(300):
        measured = TRUE * slope + rng.standard_normal(ROWS) + size * rng.standard_normal(4) @ hidden
        changes = size * rng.standard_normal((8, 4)) @ hidden
        candidate = fitted(measured, lambda a: a * slope, [0.0, 0.5, 0.8, 1.0, 2.0])
        ((low, high),) = Precision(changes).intervals(candidate)
        covered += low <= TRUE <= high
    assert covered >= 0.87 * 300
    assert size == 0.0 or covered <= 0.97 * 300


def test_an_interval_reaches_as_far_as_nothing_changes() -> None:
    """A limit that is not reached above 1.2 may be anything above that."""
    rng = np.random.default_rng(6)
    slope = rng.standard_normal(ROWS) * 8.0
    candidate = fitted(1.2 * slope, lambda a: min(a, 1.2) * slope, [0.0, 0.6, 1.2, 1.6, 2.0])
    ((low, high),) = Precision(rng.standard_normal((8, ROWS))).intervals(candidate)
    assert 1.05 < low < 1.2
    assert high == 2.0
