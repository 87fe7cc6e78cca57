"""Servos' calibrations."""

import math
from pathlib import Path
from typing import Any

import pytest
from helpers import STRIDER, problem_folder
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from gaitopt.gait.calibration import Calibration
from gaitopt.problem.problem import Problem, load_problem


def test_the_datasheet_stands_in_for_what_is_not_set() -> None:
    servo = Calibration(pin=5, trim_us=-3.0)
    assert (servo.pulse_us(0.0), servo.pulse_us(90.0)) == (1497.0, 2496.0)
    assert "trim_us" not in servo.from_datasheet
    assert {"min_us", "us_per_deg", "neutral_us"} <= set(servo.from_datasheet)
    assert servo.model_dump() == {"pin": 5, "trim_us": -3.0}
    assert servo.pulse_per_frame_us(600.0, 0.02) == 133


@given(
    angle=st.floats(-90.0, 90.0),
    servo=st.builds(Calibration, direction=st.sampled_from([-1, 1]), trim_us=st.floats(-50.0, 50.0)),
)
def test_angle_and_pulse_are_inverse(angle: float, servo: Calibration) -> None:
    assert servo.angle_deg(servo.pulse_us(angle)) == pytest.approx(angle, abs=1e-9)
    low, high = servo.range_deg
    assert low < high


@pytest.mark.parametrize(
    "values",
    [
        {"min_us": 2500},
        {"pin": -1},
        {"direction": 0},
        {"us_per_deg": 0.0},
        {"trim_us": math.inf},
        {"pins": 3},
    ],
)
def test_an_impossible_calibration_is_refused(values: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Calibration(**values)


def test_a_run_folder_still_says_what_was_not_set(tmp_path: Path) -> None:
    def wire(content: dict[str, Any]) -> None:
        content["channels"]["rear"]["servo"] = {"pin": 4, "min_us": 600}

    problem = load_problem(problem_folder(tmp_path / "one", STRIDER, wire))
    (tmp_path / "again.toml").write_text(problem.with_parameters({"mass": 0.04}).to_toml("one/strider.xml"))
    servo = load_problem(tmp_path / "again.toml").file.channels["rear"].servo
    assert servo == Calibration(pin=4, min_us=600)
    assert "max_us" in servo.from_datasheet


def test_arcfold_is_wired_as_its_team_wired_it(arcfold: Problem) -> None:
    pins = {name: channel.servo.pin for name, channel in arcfold.file.channels.items()}
    assert pins == {"mid_act": 12, "foot1": 13, "foot2": 14}
    for channel in arcfold.file.channels.values():
        low, high = channel.servo.range_deg
        assert low < channel.range_deg[0]
        assert high > channel.range_deg[1]


@pytest.mark.parametrize("value", ["1_500", "1500", "\u0661", True])
@pytest.mark.parametrize("key", ["pin", "neutral_us", "min_us", "us_per_deg"])
def test_a_text_is_no_number(key: str, value: object) -> None:
    with pytest.raises(ValueError, match="allowed: a number"):
        Calibration.model_validate({key: value})
