"""Gaits: the square wave, what smoothing keeps, and files that lose nothing."""

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import EDGE_TOLERANCE, Channel, Gait, read_gait, write_gait
from gaitopt.problem.problem import Problem

inside = st.floats(0.05, 0.95)
finite = st.floats(allow_nan=False, allow_infinity=False)
share = st.floats(0.0, 1.0)
smooth_channels = st.builds(
    Channel,
    duty=inside,
    phase=st.floats(-2.0, 2.0),
    amplitude_deg=st.floats(-90.0, 90.0),
    offset_deg=st.floats(-90.0, 90.0),
    smoothing=st.floats(0.01, 1.0),
)


def one_channel(period_s: float = 1.0, **wave: float) -> Gait:
    """A gait of one servo."""
    values = {"duty": 0.5, "phase": 0.0, "amplitude_deg": 90.0} | wave
    return Gait(period_s, {"servo": Channel(**values)})


def is_on(gait: Gait, t: float) -> bool:
    """Whether the one channel is at offset + amplitude."""
    channel = gait.channels["servo"]
    low, high = math.radians(channel.offset_deg), math.radians(channel.offset_deg + channel.amplitude_deg)
    target = float(gait.targets([t])[0, 0])
    assert target == pytest.approx(low, abs=1e-12) or target == pytest.approx(high, abs=1e-12)
    return abs(target - high) < abs(target - low)


# --- the square wave --------------------------------------------------------------------------


@given(
    t=st.floats(-50.0, 50.0),
    period_s=st.floats(0.1, 10.0),
    phase=st.floats(-2.0, 2.0),
    duty=st.floats(0.001, 0.999),
)
@example(t=0.0, period_s=4.0, phase=0.25, duty=0.5)
@example(t=1.0, period_s=4.0, phase=0.25, duty=0.5)
@example(t=2.0, period_s=4.0, phase=0.0, duty=0.5)
@example(t=3.0, period_s=4.0, phase=0.25, duty=0.5)
@example(t=2.0 - 3.9e-9, period_s=4.0, phase=0.0, duty=0.5)
@example(t=2.0 - 4.1e-9, period_s=4.0, phase=0.0, duty=0.5)
@example(t=-3.9e-9, period_s=4.0, phase=0.0, duty=0.5)
@example(t=-4.1e-9, period_s=4.0, phase=0.0, duty=0.5)
def test_the_square_wave_is_the_contracts(t: float, period_s: float, phase: float, duty: float) -> None:
    """On while (t/period + phase) mod 1 < duty; a time within 1e-9 periods before an edge is after it."""
    exact = Fraction(t) / Fraction(period_s) + Fraction(phase)
    tolerance = Fraction("1e-9")
    to_rise, to_fall = -exact % 1, (Fraction(duty) - exact) % 1
    # Within rounding of the tolerance's end, either answer is right.
    for distance in (to_rise, to_fall):
        assume(abs(distance - tolerance) > Fraction("1e-12"))
        assume(not Fraction("0.999999999999") < distance)
    if to_rise <= tolerance:
        expected = True
    elif to_fall <= tolerance:
        expected = False
    else:
        expected = exact % 1 < Fraction(duty)
    assert is_on(one_channel(period_s, phase=phase, duty=duty, offset_deg=-10.0), t) is expected


@pytest.mark.parametrize("period_s", [4.0, 2.0, 1.0, 0.5])
@pytest.mark.parametrize("clock", ["product", "sum"])
def test_edges_fall_on_the_samples_of_either_clock(period_s: float, clock: str) -> None:
    """Rounded time stamps neither lose nor add a sample of any stroke."""
    samples = 10 * round(period_s / 1e-3)
    t = np.arange(samples) * 1e-3 if clock == "product" else np.cumsum(np.full(samples, 1e-3)) - 1e-3
    on = one_channel(period_s, phase=0.25).targets(t)[:, 0] > 0.0
    first_fall = round(0.25 * period_s / 1e-3)
    expected = (np.arange(samples) - first_fall) % round(period_s / 1e-3) >= samples // 20
    assert on.tolist() == expected.tolist()


def test_the_tolerance_is_the_contracts() -> None:
    assert EDGE_TOLERANCE == 1e-9


@given(t=st.floats(-100.0, 100.0), period_s=st.floats(0.1, 10.0), phase=st.floats(-2.0, 2.0), smoothing=share)
@example(t=math.nextafter(-1e-9, -1.0), period_s=1.0, phase=0.0, smoothing=0.0)
def test_a_duty_of_one_is_always_on_and_of_zero_never(
    t: float, period_s: float, phase: float, smoothing: float
) -> None:
    wave = {"phase": phase, "smoothing": smoothing}
    assert is_on(one_channel(period_s, duty=1.0, **wave), t)
    assert not is_on(one_channel(period_s, duty=0.0, **wave), t)


def test_targets_are_in_rad_a_column_per_channel() -> None:
    high = Channel(duty=0.5, phase=0.0, amplitude_deg=90.0, offset_deg=-180.0)
    low = Channel(duty=0.5, phase=0.5, amplitude_deg=-45.0)
    targets = Gait(2.0, {"a": high, "b": low}).targets([0.0, 1.0, 2.0])
    assert targets.shape == (3, 2)
    np.testing.assert_allclose(targets[:, 0], [-math.pi / 2, -math.pi, -math.pi / 2], rtol=1e-15)
    np.testing.assert_allclose(targets[:, 1], [0.0, -math.pi / 4, 0.0], rtol=1e-15)


def test_the_phase_is_an_advance() -> None:
    cycles = np.linspace(0.0, 1.0, 1001)[:-1] + 3e-4
    early = one_channel(phase=0.25).targets(cycles)
    np.testing.assert_array_equal(early, one_channel().targets(cycles + 0.25))


# --- smoothing --------------------------------------------------------------------------------


@given(smooth_channels, st.floats(0.1, 10.0), st.integers(-3, 3))
def test_smoothing_keeps_the_wave_periodic(channel: Channel, period_s: float, cycles: int) -> None:
    gait = Gait(period_s, {"servo": channel})
    t = np.linspace(0.0, period_s, 101)
    np.testing.assert_allclose(gait.targets(t + cycles * period_s), gait.targets(t), rtol=0, atol=1e-8)


@given(smooth_channels)
def test_smoothing_keeps_the_wave_between_its_ends(channel: Channel) -> None:
    targets = np.rad2deg(Gait(1.0, {"servo": channel}).targets(np.linspace(0.0, 1.0, 501)))
    low, high = channel.extremes_deg
    assert targets.min() >= low - 1e-12 * 180.0
    assert targets.max() <= high + 1e-12 * 180.0


@given(smooth_channels, st.floats(-1.0, 1.0), st.floats(1e-6, 0.1))
def test_a_smooth_wave_never_jumps(channel: Channel, begin: float, step: float) -> None:
    """Its steps are bounded by its peak speed, edges included."""
    gait = Gait(1.0, {"servo": channel})
    before, after = gait.targets([begin, begin + step])[:, 0]
    assert abs(after - before) <= gait.peak_command_speed()[0] * step * (1.0 + 1e-6) + 1e-9


@given(smooth_channels)
def test_smoothing_moves_no_timing(channel: Channel) -> None:
    """A ramp is half done where the square wave has its edge, and the mean stays the duty."""
    square = channel.model_copy(update={"smoothing": 0.0})
    cycles = (np.arange(4000) + 0.5) / 4000 - channel.phase
    wave = channel.wave(cycles, 0.0)
    position = np.mod(cycles + channel.phase, 1.0)
    near = np.minimum(np.abs(position - channel.duty), np.minimum(position, 1.0 - position)) < 1e-6
    assert np.array_equal((wave > 0.5)[~near], square.wave(cycles, 0.0).astype(bool)[~near])
    assert wave.mean() == pytest.approx(channel.duty, abs=3e-4)


@given(inside, st.floats(-2.0, 2.0))
def test_the_square_wave_is_the_limit_of_smoothing(duty: float, phase: float) -> None:
    cycles = np.linspace(0.0, 1.0, 301)
    smoothest, square = (Channel(duty=duty, phase=phase, amplitude_deg=1.0, smoothing=s) for s in (1e-3, 0.0))
    position = np.mod(cycles + phase, 1.0)
    near = np.minimum(np.abs(position - duty), np.minimum(position, 1.0 - position)) < 1e-3
    assert np.array_equal(smoothest.wave(cycles, 0.0)[~near], square.wave(cycles, 0.0)[~near])


def test_full_smoothing_of_an_even_wave_is_a_cosine() -> None:
    t = np.linspace(-1.0, 1.0, 401)
    targets = one_channel(smoothing=1.0, phase=0.25, amplitude_deg=math.degrees(1.0)).targets(t)[:, 0]
    np.testing.assert_allclose(targets, 0.5 + 0.5 * np.cos(2.0 * np.pi * t), rtol=0, atol=1e-7)


@given(smooth_channels, st.floats(0.1, 10.0))
def test_the_peak_speed_is_the_steepest_slope(channel: Channel, period_s: float) -> None:
    gait = Gait(period_s, {"servo": channel})
    ramp = channel.ramp_cycles
    cycles = np.linspace(-0.6 * ramp, 0.6 * ramp, 2001) - channel.phase
    slopes = np.abs(np.diff(gait.targets(cycles * period_s)[:, 0])) / (np.diff(cycles) * period_s)
    assert gait.peak_command_speed()[0] == pytest.approx(slopes.max(), rel=1e-4, abs=1e-9)


def test_the_peak_speed_of_a_square_wave_is_infinite_and_of_a_constant_zero() -> None:
    assert one_channel().peak_command_speed().tolist() == [math.inf]
    for constant in ({"amplitude_deg": 0.0}, {"duty": 0.0}, {"duty": 1.0}):
        assert one_channel(**constant).peak_command_speed().tolist() == [0.0]
        assert one_channel(smoothing=0.5, **constant).peak_command_speed().tolist() == [0.0]


@given(inside, st.floats(1.0, 90.0), st.floats(0.5, 5.0), st.floats(1.0, 20.0))
def test_from_some_smoothing_on_a_gait_is_within_a_speed_limit(
    duty: float, amplitude_deg: float, period_s: float, limit: float
) -> None:
    def speed(smoothing: float) -> float:
        gait = one_channel(period_s, duty=duty, amplitude_deg=amplitude_deg, smoothing=smoothing)
        return float(gait.peak_command_speed()[0])

    enough = math.radians(amplitude_deg) * math.pi / (2.0 * limit * period_s * min(duty, 1.0 - duty))
    assume(1e-3 < enough < 0.99)
    assert speed(enough * 0.999) > limit > speed(enough * 1.001)
    assert speed(1.0) < limit


def test_another_period_keeps_the_wave() -> None:
    slow = one_channel(4.0, phase=0.1, smoothing=0.3)
    fast = slow.with_period(0.5)
    t = np.linspace(0.0, 4.0, 1000)
    np.testing.assert_allclose(fast.targets(t / 8.0), slow.targets(t), rtol=0, atol=1e-12)


# --- files ------------------------------------------------------------------------------------

any_gait = st.builds(
    Gait,
    period_s=st.floats(1e-3, 1e6),
    channels=st.dictionaries(
        st.text(st.characters(codec="utf-8"), max_size=8),
        st.builds(
            Channel, duty=share, phase=finite, amplitude_deg=finite, offset_deg=finite, smoothing=share
        ),
        min_size=1,
        max_size=4,
    ),
    name=st.just("gait"),
)


@given(any_gait)
def test_a_gait_file_loses_nothing(scratch: Path, gait: Gait) -> None:
    path = scratch / "gait.toml"
    write_gait(path, gait)
    back = read_gait(path)
    assert back == gait
    assert list(back.channels) == list(gait.channels)
    assert repr(back.to_dict()) == repr(gait.to_dict())  # tells -0.0 from 0.0, too


def test_a_gait_is_named_after_its_file(tmp_path: Path) -> None:
    write_gait(tmp_path / "walk.toml", one_channel())
    assert read_gait(tmp_path / "walk.toml").name == "walk"


def test_what_a_gait_file_leaves_out_is_neutral(tmp_path: Path) -> None:
    path = tmp_path / "gait.toml"
    path.write_text("period_s = 1\n[channels.servo]\nduty = 0.5\nphase = 0\namplitude_deg = 90\n")
    assert read_gait(path) == Gait(1.0, one_channel().channels, "gait")


WAVE = "[channels.servo]\nduty = 0.5\nphase = 0.0\namplitude_deg = 90.0\n"
GOOD = "period_s = 1.0\n" + WAVE
CHANNEL_KEYS = "duty, phase, amplitude_deg, offset_deg, smoothing"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "period = 1.0\nperiod_s = 1.0\n" + WAVE,
            "period: unknown key; allowed: period_s, channels (nearest: 'period_s')",
        ),
        (
            GOOD + "dutty = 0.5\n",
            f"channels.servo.dutty: unknown key; allowed: {CHANNEL_KEYS} (nearest: 'duty')",
        ),
        (
            GOOD.replace("duty = 0.5", "duty = 1.5"),
            "channels.servo.duty: found 1.5; allowed: less than or equal to 1",
        ),
        (
            GOOD.replace("duty = 0.5", "duty = -0.1"),
            "channels.servo.duty: found -0.1; allowed: greater than or equal to 0",
        ),
        (GOOD + "smoothing = 2", "channels.servo.smoothing: found 2; allowed: less than or equal to 1"),
        (
            GOOD.replace("period_s = 1.0", "period_s = -1.0"),
            "period_s: found -1.0; allowed: greater than or equal to 0.001",
        ),
        (
            GOOD.replace("period_s = 1.0", "period_s = 0.0"),
            "period_s: found 0.0; allowed: greater than or equal to 0.001",
        ),
        (
            GOOD.replace("phase = 0.0", "phase = nan"),
            "channels.servo.phase: found nan; allowed: a finite number",
        ),
        (GOOD.replace("period_s = 1.0", "period_s = inf"), "period_s: found inf; allowed: a finite number"),
        (
            GOOD.replace("duty = 0.5", 'duty = "half"'),
            "channels.servo.duty: found 'half'; allowed: a valid number",
        ),
        (WAVE, "period_s: missing; it is required"),
        ("period_s = 1.0\n", "channels: missing; it is required"),
        (GOOD.replace("duty = 0.5\n", ""), "channels.servo.duty: missing; it is required"),
        (
            "period_s = -1.0\n" + WAVE.replace("0.5", "7"),
            "period_s: found -1.0; allowed: greater than or equal to 0.001 (and 1 more)",
        ),
        ("period_s = \n", "not TOML: Invalid value (at line 1, column 12)"),
    ],
    ids=lambda text: text.partition(";")[0] if ";" in text else "",
)
def test_a_bad_gait_file_is_one_line(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "gait.toml"
    path.write_text(text)
    with pytest.raises(GaitoptError) as error:
        read_gait(path)
    assert str(error.value) == f"{path}: {problem}"


def test_a_file_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "gait.toml"
    with pytest.raises(GaitoptError) as error:
        read_gait(path)
    assert str(error.value) == f"{path}: no such file"
    path.write_bytes(b"period_s = 1.0 # \xff\n")
    with pytest.raises(GaitoptError) as error:
        read_gait(path)
    assert str(error.value) == f"{path}: not UTF-8 text (byte 17)"
    with pytest.raises(GaitoptError) as error:
        read_gait(tmp_path)
    assert str(error.value) == f"{tmp_path}: found a folder; allowed: a plain file"


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match="cannot be written: No such file or directory"):
        write_gait(tmp_path / "missing" / "gait.toml", one_channel())
    (tmp_path / "gait.toml").mkdir()
    with pytest.raises(GaitoptError, match="cannot be written: found a folder"):
        write_gait(tmp_path / "gait.toml", one_channel())
    assert [path.name for path in tmp_path.iterdir()] == ["gait.toml"]


# --- the published gaits ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "period_s"), [("square-4s", 4.0), ("square-2s", 2.0), ("square-1s", 1.0), ("square-0.5s", 0.5)]
)
def test_the_hand_tuned_gaits_are_square_waves(arcfold: Problem, name: str, period_s: float) -> None:
    gait = arcfold.baselines[name]
    assert (gait.name, gait.period_s) == (name, period_s)
    assert all(channel.smoothing == 0.0 for channel in gait.channels.values())
    assert [(c.duty, c.phase) for c in gait.channels.values()] == [(0.5, 0.25), (0.5, 0.0), (0.5, 0.5)]
