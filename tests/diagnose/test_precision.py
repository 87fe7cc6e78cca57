"""How well a parameter is known: intervals cover, and reach far where the loss is flat."""

import numpy as np
import pytest
from toyfits import toy_bench, toy_fit, toy_point

from gaitopt.diagnose.fit import response
from gaitopt.diagnose.fit.pairs import PairFit
from gaitopt.diagnose.judge import precision
from gaitopt.diagnose.judge.evidence import Candidate

ROWS, TRUE = 60, 0.9


def fitted(measured, predicted, at):
    """A fit of one parameter between 0 and 2, simulated at some coordinates, and its candidate."""
    fit = toy_fit(toy_bench(ROWS, 6), measured, predicted, at, high=2.0)
    loss = fit.loss()
    return Candidate((fit,), (fit.best(),), loss, loss, fit.between("whitened"), np.empty(0), 0.0)


@pytest.mark.parametrize("size", [0.0, 10.0])
def test_nine_in_ten_intervals_cover_whatever_nobody_knows_of_the_robot(size):
    """Errors of noise alone are over-covered: its squares count tempered."""
    rng = np.random.default_rng(5)
    slope, hidden = rng.standard_normal(ROWS) * 8.0, rng.standard_normal((4, ROWS)) / 2.0
    covered = 0
    for _ in range(300):
        measured = TRUE * slope + rng.standard_normal(ROWS) + size * rng.standard_normal(4) @ hidden
        drawn = size * rng.standard_normal((8, 4)) @ hidden
        candidate = fitted(measured, lambda a: a * slope, [0.0, 0.5, 0.8, 1.0, 2.0])
        ((low, high),) = precision.intervals(candidate, candidate.fits[0].trial_set, drawn)
        covered += low <= TRUE <= high
    assert covered >= 0.87 * 300
    assert size == 0.0 or covered <= 0.97 * 300


def test_an_interval_reaches_as_far_as_nothing_changes():
    """A limit that is not reached above 1.2 may be anything above that."""
    rng = np.random.default_rng(6)
    slope = rng.standard_normal(ROWS) * 8.0
    candidate = fitted(1.2 * slope, lambda a: min(a, 1.2) * slope, [0.0, 0.6, 1.2, 1.6, 2.0])
    ((low, high),) = precision.intervals(
        candidate, candidate.fits[0].trial_set, rng.standard_normal((8, ROWS))
    )
    assert 1.05 < low < 1.2
    assert high == 2.0


def test_an_interval_of_a_pair_covers_too():
    rng = np.random.default_rng(7)
    slopes, hidden = rng.standard_normal((ROWS, 2)) * 8.0, 3.0 * rng.standard_normal((4, ROWS))
    fits = fitted(np.zeros(ROWS), lambda a: a * slopes[:, 0], [0.0, 2.0]).fits * 2
    covered = 0
    for _ in range(300):
        unknown = rng.standard_normal(ROWS) + rng.standard_normal(4) @ hidden
        at = np.full(2, TRUE) + np.linalg.lstsq(slopes, unknown, rcond=None)[0]
        left = unknown - slopes @ (at - TRUE)
        pair = PairFit(fits, [toy_point(at, left)], -slopes)
        losses = fits[0].trial_set.losses(left, left)
        candidate = Candidate(fits, tuple(at.tolist()), losses, losses, left, np.empty(0), 0.0, pair)
        drawn = rng.standard_normal((8, 4)) @ hidden
        found = precision.intervals(candidate, fits[0].trial_set, drawn)
        covered += sum(low <= TRUE <= high for low, high in found)
    assert 0.85 * 600 <= covered <= 0.97 * 600


@pytest.mark.parametrize("size", [0.0, 3.0])
def test_jumps_are_told_from_slopes(size):
    """Robots a thousandth of the range apart have the slope of the whole, however each of them jumps."""
    rng = np.random.default_rng(8)
    slope, jumps = rng.standard_normal(ROWS) * 40.0, size * rng.standard_normal((5, ROWS))
    at = [0.0, 0.898, 0.9, 0.902, 2.0]
    candidate = fitted(TRUE * slope, lambda a: a * slope + jumps[at.index(a)], at)
    found = response.of_fit(candidate.fits[0])
    assert np.linalg.norm(found.slopes[:, 0] + 2.0 * slope) <= 0.1 * np.linalg.norm(2.0 * slope)
    assert found.jump == pytest.approx(2.0 * ROWS * size**2, rel=0.5, abs=1e-9)
    assert (found.luck > 1.0) == (size > 0.0)
