"""Labels of metrics and other figures."""

import pytest

from gaitopt.simulation.labels import label_of, shown, title_of
from gaitopt.simulation.metrics import METRICS


def test_a_person_reads_units() -> None:
    assert (label_of("speed_m_s"), shown("speed_m_s", 0.0716)) == ("forward speed [mm/s]", "71.6")
    assert (label_of("yaw_rate_rad_s"), shown("yaw_rate_rad_s", 1.0)) == ("turning rate [°/s]", "57.3")
    assert (label_of("reached.foot1"), shown("reached.foot1", 0.866)) == ("travel reached, foot1 [%]", "86.6")
    assert [title_of(name) for name in ("stride_m", "unrest_at_start")] == ["stride", "unrest at start"]
    assert shown("violations", {"tilt_rad": 1.0}) == "largest tilt"
    assert (shown("x", None), shown("x", True), shown("x_m", [0.1, 0.2])) == ("–", "yes", "100 to 200")


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_has_a_title_of_its_own(name: str) -> None:
    titles = [title_of(other) for other in METRICS]
    assert titles.count(title_of(name)) == 1
    assert METRICS[name].share == ("[%]" in label_of(name))
