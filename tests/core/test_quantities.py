"""Quantities as a person reads them."""

import math

from gaitopt.core.quantities import figure, label_of, shown, title_of


def test_a_person_reads_units() -> None:
    assert (label_of("speed_m_s"), shown("speed_m_s", 0.0716)) == ("forward speed [mm/s]", "71.6")
    assert (label_of("yaw_rate_rad_s"), shown("yaw_rate_rad_s", 1.0)) == ("turning rate [°/s]", "57.3")
    assert (label_of("reached.foot1"), shown("reached.foot1", 0.866)) == ("travel reached, foot1 [%]", "86.6")
    assert [title_of(name) for name in ("stride_m", "unrest_at_start")] == ["stride", "unrest at start"]
    assert [figure(v) for v in (math.nan, math.inf, 4.0, 1234.5, 2e7, 1e-6)] == [
        "–", "∞", "4", "1234", "2.0e+07", "1.0e-06",
    ]  # fmt: skip
    assert shown("violations", {"tilt_rad": 1.0}) == "largest tilt"
    assert (shown("x", None), shown("x", True), shown("x_m", [0.1, 0.2])) == ("–", "yes", "100 to 200")
