"""Gaits compared: the ratios of their speeds."""

import numpy as np
import pytest

from gaitopt.optimise.compare import paired_ratio


def test_a_ratio_has_an_interval_where_the_first_gait_goes_forward() -> None:
    assert paired_ratio(np.array([2.0, 4.1, 6.0]), np.array([-1.0, 2.0, 0.5])) is None
    ratio = paired_ratio(np.array([2.0, 4.1, 6.0]), np.array([1.0, 2.0, 3.0]))
    assert ratio is not None
    assert ratio.value == pytest.approx(12.1 / 6.0)
    assert ratio.ci90[0] < ratio.value < ratio.ci90[1] < 2.2
    assert np.mean(ratio.ci90) == pytest.approx(ratio.value)
