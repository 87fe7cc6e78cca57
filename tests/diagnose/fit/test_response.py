"""The response near a robot: slopes from many robots together, and jumps separate from slopes."""

import numpy as np
import pytest
from toyfits import toy_fit, toy_trials

from gaitopt.diagnose.fit.response import Response

ROWS, TRUE = 60, 0.9


@pytest.mark.parametrize("size", [0.0, 3.0])
def test_jumps_are_told_from_slopes(size: float) -> None:
    """Robots a thousandth of the range apart get the slope of the whole, although each of them jumps."""
    rng = np.random.default_rng(8)
    slope, jumps = rng.standard_normal(ROWS) * 40.0, size * rng.standard_normal((5, ROWS))
    at = [0.0, 0.898, 0.9, 0.902, 2.0]
    fit = toy_fit(toy_trials(ROWS, 6), TRUE * slope, lambda a: a * slope + jumps[at.index(a)], at, high=2.0)
    found = Response.of_fit(fit)
    assert np.linalg.norm(found.slopes[:, 0] + 2.0 * slope) <= 0.1 * np.linalg.norm(2.0 * slope)
    assert found.jump == pytest.approx(2.0 * ROWS * size**2, rel=0.5, abs=1e-9)
    assert (found.loss_jumps > 1.0) == (size > 0.0)
