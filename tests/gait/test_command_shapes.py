"""Shapes of commands: they begin at rest, stay in the range, and ramps are no faster than the servo."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.gait.command_shapes import (
    LONGEST_S,
    ROW_S,
    SHAPES,
    SHORTEST_S,
    Shape,
    ShapedCommands,
    Size,
    Travel,
    shaped,
)

BY_NAME = {shape.name: shape for shape in SHAPES}
RIG = Travel(
    ("arm", "wrist"), np.array([0.1, 0.0]), np.array([[-1.0, 2.0], [0.0, 1.5]]), np.array([9.0, 3.0])
)


def tried(
    name: str, share: float, time_s: float | None = None, moving: tuple[int, ...] = (0,), seed: int = 1
) -> ShapedCommands | None:
    """The commands of a shape on the rig, if there is room for them."""
    shape = BY_NAME[name]
    return shaped(shape, Size(share, time_s or shape.times_s[0], moving), RIG, seed)


def of(
    name: str, share: float, time_s: float | None = None, moving: tuple[int, ...] = (0,)
) -> ShapedCommands:
    """The same, where there is room."""
    made = tried(name, share, time_s, moving)
    assert made is not None
    return made


@given(
    st.sampled_from(SHAPES),
    st.floats(-1.0, 1.0),
    st.floats(0.02, 2.0),
    st.sampled_from([(0,), (1,), (0, 1)]),
    st.floats(0.2, 50.0),
    st.floats(-1.0, 2.0),
)
def test_commands_are_safe_whatever_their_size(
    shape: Shape, share: float, time_s: float, moving: tuple[int, ...], speed: float, rest: float
) -> None:
    travel = Travel(RIG.channels, np.array([rest, 0.7]), RIG.ranges, np.array([speed, 0.5 * speed]))
    made = shaped(shape, Size(share, time_s, moving), travel)
    if made is None:
        return
    rows = made.commands.rows
    low, high = travel.ranges.T
    powered = np.isfinite(rows)
    assert np.all((rows >= low) & (rows <= high) | ~powered)
    assert np.all(rows[0] == travel.rest)
    assert powered.all() or shape.name == "drop"
    assert SHORTEST_S <= made.commands.duration_s <= LONGEST_S + 1e-9
    assert np.allclose(np.diff(made.commands.time), ROW_S)
    still = [i for i in range(2) if i not in moving]
    assert np.all(rows[:, still] == travel.rest[still])
    if not shape.jumps:
        assert np.all(np.abs(np.diff(rows, axis=0)) <= travel.speeds * ROW_S * (1.0 + 1e-9))


@pytest.mark.parametrize("name", BY_NAME)
def test_every_shape_has_a_small_and_a_large_size(name: str) -> None:
    for share in (0.06, 0.9):
        made = of(name, share)
        assert np.nanmax(np.abs(made.commands.rows[:, 0] - 0.1)) > 0.05


def test_a_step_goes_up_or_down_from_rest_and_back() -> None:
    up, down = of("step", 0.5), of("step", -0.5)
    assert sorted(set(up.commands.rows[:, 0].tolist())) == [0.1, 0.1 + 0.5 * 1.9]
    assert sorted(set(down.commands.rows[:, 0].tolist())) == [0.1 - 0.5 * 1.1, 0.1]
    assert up.amplitude_rad == pytest.approx(0.95)
    assert down.amplitude_rad == pytest.approx(-0.55)
    assert up.commands.rows[-1, 0] == 0.1


def test_a_shape_that_needs_both_sides_moves_from_rest_to_its_centre_first() -> None:
    made = of("square", 0.5, moving=(1,))
    wrist = made.commands.rows[:, 1]
    assert wrist[0] == 0.0
    assert wrist.max() - wrist.min() == pytest.approx(0.75)
    assert made.amplitude_rad == pytest.approx(0.375)


def test_a_ramp_beyond_the_servos_speed_takes_longer() -> None:
    slow, fast = of("ramp", 0.9, 0.02, moving=(1,)), of("ramp", 0.9, 1.2, moving=(1,))
    largest = np.abs(np.diff(slow.commands.rows[:, 1])).max() / ROW_S
    assert 2.7 < largest <= 3.0
    assert slow.commands.duration_s < fast.commands.duration_s


def test_a_chirp_gets_faster_up_to_what_the_servo_can() -> None:
    small, large = of("chirp", 0.1, moving=(1,)), of("chirp", 0.6, moving=(1,))
    turns = [int(np.sum(np.diff(np.sign(np.diff(made.commands.rows[:, 1]))) != 0)) for made in (small, large)]
    assert turns[0] > turns[1] > 2


def test_a_telegraph_is_the_same_for_the_same_seed_alone() -> None:
    keys = [made.commands.key for made in (tried("telegraph", 0.5, seed=seed) for seed in (1, 1, 2)) if made]
    assert keys[0] == keys[1] != keys[2]


def test_a_drop_cuts_the_power_away_from_rest() -> None:
    made = of("drop", 0.5)
    arm, wrist = made.commands.rows.T
    cut = int(np.flatnonzero(np.isnan(arm))[0])
    assert arm[cut - 1] == pytest.approx(0.1 + 0.95)
    assert np.isnan(arm[cut:]).all()
    assert np.isfinite(wrist).all()


def test_what_has_no_room_is_no_command() -> None:
    assert tried("step", -0.5, moving=(1,)) is None
    assert tried("step", 1e-4) is None
    assert tried("ramp", 0.9, 5.0) is None


def test_all_channels_may_move_together() -> None:
    made = of("square", 0.5, moving=(0, 1))
    assert made.channel == "all"
    assert math.isclose(made.amplitude_rad, 0.75)
    assert np.all(np.ptp(made.commands.rows, axis=0) > 0.5)
