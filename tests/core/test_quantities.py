"""Units and digits of figures."""

import math

import pytest

from gaitopt.core.quantities import figure, stem_of, unit_of


def test_a_figure_has_three_digits() -> None:
    assert [figure(v) for v in (math.nan, math.inf, 4.0, 1234.5, 2e7, 1e-6)] == [
        "–", "∞", "4", "1234", "2.0e+07", "1.0e-06",
    ]  # fmt: skip


def test_a_unit_is_the_longest_suffix() -> None:
    assert (stem_of("speed_m_s"), unit_of("speed_m_s")) == ("speed", ("mm/s", 1e3))
    assert (stem_of("peak_torque_n_m"), unit_of("peak_torque_n_m")) == ("peak_torque", ("N m", 1.0))
    assert unit_of("yaw_rate_rad_s") == ("°/s", pytest.approx(57.29578))
    assert (stem_of("ratio"), unit_of("ratio")) == ("ratio", ("", 1.0))
