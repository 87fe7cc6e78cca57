"""Logged commands: what holds when, which logs are the same, and in which blocks they are judged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import LoggedCommands

OFF = math.nan


def log(time: list[float], rows: list[list[float]]) -> LoggedCommands:
    """A log of as many servos as a row has targets."""
    return LoggedCommands.of([f"servo{i}" for i in range(len(rows[0]))], time, rows)


def test_a_row_holds_until_the_next_one() -> None:
    drive = log([0.0, 0.1, 0.3], [[1.0], [2.0], [3.0]])
    assert isinstance(drive, Drive)
    held = drive.targets([-1.0, 0.0, 0.0999, 0.1, 0.2999, 0.3, 9.0])
    assert held[:, 0].tolist() == [1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]


def test_a_clock_of_summed_steps_meets_the_rows() -> None:
    drive = log([0.02 * i for i in range(100)], [[float(i)] for i in range(100)])
    clock = np.arange(0.0, 2.0, 1e-3)
    assert drive.targets(clock)[:, 0].tolist() == [float(i // 20) for i in range(2000)]


def test_gait_time_0_is_the_first_row() -> None:
    drive = log([1.7e9, 1.7e9 + 0.5], [[1.0], [2.0]])
    assert (drive.first_s, drive.duration_s) == (1.7e9, 1.0)
    assert drive.targets([0.4, 0.6])[:, 0].tolist() == [1.0, 2.0]


def test_an_unpowered_servo_has_no_target() -> None:
    drive = log([0.0, 0.2, 0.4], [[1.0, 5.0], [OFF, 6.0], [1.0, OFF]])
    assert np.array_equal(
        drive.targets([0.1, 0.3, 0.5]), [[1.0, 5.0], [OFF, 6.0], [1.0, OFF]], equal_nan=True
    )


def test_rows_that_repeat_the_one_before_do_not_make_another_command() -> None:
    dense = log([0.0, 0.1, 0.2, 0.3, 0.4], [[0.0], [0.0], [OFF], [OFF], [1.0]])
    sparse = log([5.0, 5.2, 5.4], [[-0.0], [OFF], [1.0]])
    assert dense.key == sparse.key
    assert dense.key != log([0.0, 0.2, 0.4], [[0.0], [OFF], [1.1]]).key
    assert dense.key != log([0.0, 0.2, 0.5], [[0.0], [OFF], [1.0]]).key
    assert dense.key != log([0.0, 0.2, 0.4], [[0.0], [0.0], [1.0]]).key


def test_another_start_is_another_drive() -> None:
    drive = log([0.0, 0.2], [[0.0], [1.0]])
    here, there = (drive.recorded(1.0, 0.02, {"elbow": angle}) for angle in (0.1, 0.2))
    assert len({drive.key, here.key, there.key}) == 3
    assert drive.commands_key == here.commands_key == there.commands_key
    assert here.key == drive.recorded(3.0, 0.01, {"elbow": 0.1}).key


@pytest.mark.parametrize(
    ("rows", "step_s", "frame_s", "blocks"),
    [
        (12, 0.02, 0.02, 1),
        (150, 0.02, 0.02, 12),
        (50, 0.02, 0.02, 4),
        (4, 0.02, 0.02, 1),
        (100, 0.1, 0.1, 25),
    ],
)
def test_blocks_are_equal_and_last_about_a_quarter_of_a_second(
    rows: int, step_s: float, frame_s: float, blocks: int
) -> None:
    drive = log([i * step_s for i in range(rows)], [[0.0]] * rows).recorded(0.0, frame_s)
    assert drive.duration_s == pytest.approx(rows * step_s)
    assert drive.block_s * blocks == pytest.approx(drive.duration_s)
    assert drive.block_s >= 4 * frame_s * (1.0 - 1e-9)


def test_commands_last_as_long_as_their_longest_recording() -> None:
    drive = log([0.0], [[1.0]])
    assert drive.duration_s == 1.0
    assert drive.recorded(3.0, 0.02).duration_s == 3.0
    assert drive.recorded(3.0, 0.02).block_s == pytest.approx(0.25)


def test_targets_beyond_the_travel_of_a_servo_are_named() -> None:
    ranges = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    drive = LoggedCommands.of(
        ["here", "there"], [0.0, 0.1, 0.2], [[0.0, 0.5], [2.0, OFF], [-0.5, 1.0]], ranges=ranges
    )
    assert drive.beyond_range == {"here": (-0.5, 2.0)}
    assert log([0.0], [[9.0]]).beyond_range == {}
