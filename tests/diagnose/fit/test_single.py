"""The fit of one effect: which robot it simulates next, and what it predicts between simulated robots."""

import numpy as np
import pytest
from toyfits import toy_fit, toy_trials


def test_a_fit_goes_no_farther_than_robots_can_be_simulated() -> None:
    """If the outermost value fails, the range before it is refined, and the range beyond it is not tried."""
    measured, slope = np.full(8, 0.7), np.ones(8)
    fit = toy_fit(toy_trials(8, 2), measured, lambda a: a * slope, (0.0, 0.5, 1.0))
    assert fit.best() == pytest.approx(0.7, abs=0.02)
    fit = toy_fit(toy_trials(8, 2), measured, lambda a: a * slope, (0.0, 0.5))
    fit.add(1.0, None)
    assert fit.best() == 0.5
    at = fit.next_coordinate()
    assert at is not None
    assert at < 0.5
    fit.add(at, None)
    assert fit.next_coordinate() is None


def test_residuals_are_linear_between_robots() -> None:
    """So the curve's loss and products are those of the mixed residual."""
    rng = np.random.default_rng(2)
    measured, bend = rng.standard_normal((2, 8))
    fit = toy_fit(toy_trials(8, 2), measured, lambda a: a**2 * bend, (0.0, 0.5, 1.0))
    row = rng.standard_normal(8)
    for at, loss, product in zip(fit.curve.at, fit.curve.losses.sum(axis=0), fit.products(row), strict=True):
        mixed, _ = fit.line(float(at))
        assert loss == pytest.approx(float(mixed @ mixed))
        assert product == pytest.approx(float(mixed @ row))


def test_the_best_value_is_taken_with_the_robots_beside_it() -> None:
    measured, slope = np.full(8, 0.7), np.ones(8)
    fit = toy_fit(toy_trials(8, 2), measured, lambda a: a * slope, (0.0, 0.2, 0.6, 1.0))
    assert fit.around_best() == pytest.approx([0.6, 0.7, 1.0], abs=0.02)
    at_end = toy_fit(toy_trials(8, 2), 2.0 * measured, lambda a: a * slope, (0.0, 0.2, 0.6, 1.0))
    assert at_end.around_best() == [0.6, 1.0]
    nothing = toy_fit(toy_trials(8, 2), 0.0 * measured, lambda a: a * slope, (0.0, 0.2, 0.6, 1.0))
    assert nothing.around_best() == [0.2]  # not the neutral robot, which is known


def test_what_was_simulated_is_not_screened_again() -> None:
    fit = toy_fit(toy_trials(8, 2), np.ones(8), lambda a: a * np.ones(8), (0.0, 0.6))
    assert fit.unscreened() == pytest.approx([0.2, 1.0])
    fit.add(1.0, None)
    assert fit.unscreened() == pytest.approx([0.2])
