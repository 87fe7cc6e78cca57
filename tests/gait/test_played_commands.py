"""Commands as a player sends them: whole pulses where a servo is calibrated, radians elsewhere."""

import math

import numpy as np

from gaitopt.gait.calibration import Calibration
from gaitopt.gait.logged import LoggedCommands
from gaitopt.gait.played_commands import PlayedCommands

SERVOS = {"a": Calibration(neutral_us=1500.0, us_per_deg=10.0, max_us=1900), "b, c": Calibration(pin=3)}


def played(*rows: tuple[float, float]) -> PlayedCommands:
    """The table of some rows, rad."""
    time = [index / 50 for index in range(len(rows))]
    return PlayedCommands.of(LoggedCommands.of(list(SERVOS), time, rows), SERVOS)


def test_pulses_are_whole_and_angles_are_exact() -> None:
    table = played((0.0, 0.1), (math.radians(3.14), 0.3), (math.nan, math.nan))
    assert table.rows == ((1500, 0.1), (1531, 0.3), (None, None))
    assert table.units == ("us", "rad")
    assert not table.in_pulses
    assert table.to_csv() == 't_s,a_us,"b, c_rad"\n0.0,1500,0.1\n0.02,1531,0.3\n0.04,,\n'


def test_the_commands_are_those_of_the_cells() -> None:
    commands = played((0.0, 0.1), (math.radians(3.14), 0.3), (math.nan, math.nan)).commands
    assert np.allclose(commands.rows, [[0.0, 0.1], [math.radians(3.1), 0.3], [math.nan] * 2], equal_nan=True)


def test_no_pulse_is_outside_what_the_servo_takes() -> None:
    table = played((math.radians(80.0), 0.0))
    assert table.rows == ((1900, 0.0),)
    assert np.isclose(table.commands.rows[0, 0], math.radians(40.0))


def test_a_pin_alone_is_no_calibration() -> None:
    assert not SERVOS["b, c"].is_calibrated
    assert Calibration(trim_us=5.0).is_calibrated
