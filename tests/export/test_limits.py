"""What servos can do: ranges, pins, start pose and lag."""

from concurrent.futures import Executor
from pathlib import Path

import pytest
from exporting import leaning
from helpers import edited

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.export.handover import Choices, prepare
from gaitopt.export.lag import lags
from gaitopt.gait.table import read_table
from gaitopt.problem.problem import Problem, load_problem


def test_a_gait_outside_the_range_is_refused_with_channel_time_value_and_limit(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gait = tmp_path / "far.toml"
    gait.write_text(leaning(20.0, -80.0).to_toml())
    command = ["export", str(wired_folder), str(gait), "--format", "c", "--out", str(tmp_path / "out")]
    assert main(command) == 1
    assert capsys.readouterr().err == (
        "gaitopt: channels.rear: found a target of -60 degrees at 0.125 s of the cycle; allowed: -45 to 45, "
        "the servo's range (--clip exports the nearest gait inside it)\n"
    )
    assert not (tmp_path / "out").exists()
    assert main([*command, "--clip"]) == 0
    assert "warning: rear: targets from 20 to -60 degrees clipped to 20 to -45" in capsys.readouterr().out
    read = read_table(tmp_path / "out" / "table.h").gait
    assert (read.channels["rear"].offset_deg, read.channels["rear"].amplitude_deg) == (20.0, -65.0)


def test_a_servos_pulses_limit_the_gait_too(wired_folder: Path, serial: Executor) -> None:
    edited(wired_folder / "problem.toml", "pin = 4", "pin = 4\nmax_us = 1833")
    problem = load_problem(wired_folder)
    with pytest.raises(
        GaitoptError, match=r"found a target of 40 degrees at 0.125 s .*: -45 to 30, "
    ) as error:
        prepare(problem, leaning(0.0, 40.0), Choices("c"), serial)
    assert "channels.rear" in str(error.value)
    handover = prepare(problem, leaning(0.0, 40.0), Choices("c", clip=True), serial)
    assert handover.table.gait.channels["rear"].amplitude_deg == pytest.approx(30.0)
    assert max(row[0] for row in handover.table.pulses) == 1833


def test_pins_are_distinct_and_sane(wired_folder: Path, serial: Executor) -> None:
    problem = load_problem(wired_folder)
    gait = problem.baselines["stride"]
    with pytest.raises(GaitoptError, match=r"rear.servo.pin: found 4; allowed: not the pin of --led-pin"):
        prepare(problem, gait, Choices("c", led_pin=4), serial)
    edited(wired_folder / "problem.toml", "pin = 4", "pin = 35")
    warnings = prepare(load_problem(wired_folder), gait, Choices("c", led_pin=6), serial).warnings
    assert "rear: GPIO35 of a classic ESP32 is an input only" in warnings
    assert "LED: GPIO6 belongs to the flash of a classic ESP32" in warnings


def test_a_start_pose_that_the_servo_cannot_reach_is_refused(wired_folder: Path, serial: Executor) -> None:
    edited(wired_folder / "problem.toml", "pin = 4", "pin = 4\nmin_us = 1600")
    problem = load_problem(wired_folder)
    with pytest.raises(GaitoptError, match=r"start.ctrl_deg.rear: found 'a pulse of 1500 µs'; allowed: 1600"):
        prepare(problem, problem.baselines["stride"], Choices("c"), serial)


def test_lag_is_the_travel_over_the_speed_for_a_square_wave(wired: Problem) -> None:
    found = {lag.channel: lag for lag in lags(wired, leaning(0.0, 40.0))}
    assert found["rear"].angle_deg == pytest.approx(40.0)
    assert found["rear"].time_s == pytest.approx(40.0 / 600.0, abs=2e-3)
    slow = wired.baselines["stride"].with_period(20.0)
    assert lags(wired, slow) == []
