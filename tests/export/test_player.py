"""The exported player: for any table and any clock, C and Python send the same pulses, within every servo's
limits.

Compilers that are not installed are skipped; .ci/run installs them.
"""

import ctypes
import random
import re
import shutil
from pathlib import Path

import pytest
from c_player import CPlayer
from hypothesis import given, settings
from hypothesis import strategies as st
from players import (
    HERE,
    IN_ANY_LANGUAGE,
    MALFORMED,
    SANITIZED,
    STRICT,
    TEMPLATES,
    exported,
    files_of,
    run,
    table,
    tool,
)

from gaitopt.export.formats import FORMATS
from gaitopt.export.gait_player import HOLDING, OFF, RAMP_US, STAGGER_US, WALKING, Player
from gaitopt.export.stages import player_of


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    compiler = tool("gcc")
    path = tmp_path_factory.mktemp("player") / "player.so"
    traps = ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
    run(compiler, *STRICT, *traps, "-O1", "-fPIC", "-shared", TEMPLATES / "gait_player.c", "-o", path)
    loaded = ctypes.CDLL(str(path))
    loaded.gait_tick.restype = ctypes.c_bool
    return loaded


@st.composite
def tables(draw: st.DrawFn) -> tuple[int, int, tuple, tuple]:
    """A period, a frame, servos and pulses: any that a table can hold."""
    count, samples = draw(st.integers(1, 4)), draw(st.integers(1, 9))
    servos = []
    for _ in range(count):
        low, high = sorted(draw(st.tuples(st.integers(1, 65535), st.integers(1, 65535))))
        start = draw(st.integers(low, high))
        servos.append((-1, start, low, high, draw(st.one_of(st.just(0), st.integers(1, 3000)))))
    pulses = draw(st.lists(st.integers(0, 65535), min_size=count * samples, max_size=count * samples))
    period, frame = draw(st.integers(1, 2**32 - 1)), draw(st.integers(1_000, 100_000))
    return period, frame, tuple(servos), tuple(pulses)


steps = st.lists(
    st.one_of(
        st.tuples(st.just("t"), st.integers(0, 120_000)),
        st.tuples(st.just("t"), st.sampled_from([300_000, 1_500_000, 2**31, 2**32 - 1])),
        st.tuples(st.sampled_from("gsr"), st.just(0)),
        st.tuples(st.just("p"), st.integers(0, 2**32 - 1)),
    ),
    max_size=60,
)


@settings(max_examples=300)
@given(made=tables(), first=st.integers(0, 2**32 - 1), moves=steps)
def test_any_table_any_clock_same_pulses_within_range_and_slew(
    library: ctypes.CDLL, made: tuple, first: int, moves: list[tuple[str, int]]
) -> None:
    one, other = Player(*made), CPlayer(library, *made)
    now = first
    for player in (one, other):
        player.start(now)
    before = list(one.pulse_us)
    for what, value in moves:
        ticked = []
        for player in (one, other):
            if what == "t":
                ticked.append(player.tick((now + value) % 2**32))
            elif what == "g":
                player.start(now)
            elif what == "p":
                player.set_period(value)
            else:
                player.stop() if what == "s" else player.release()
        now = (now + value) % 2**32 if what == "t" else now
        assert (one.state, one.pulse_us) == (other.state, other.pulse_us)
        assert len(set(ticked)) <= 1
        for pulse, last, (_, _, low, high, slew) in zip(one.pulse_us, before, made[2], strict=True):
            assert pulse == 0 or low <= pulse <= high
            assert not (pulse and last and slew) or abs(pulse - last) <= slew
        before = list(one.pulse_us)


def test_a_million_random_ticks_stay_within_range_and_slew(tmp_path: Path) -> None:
    """On tables of any content, with clock wraps, new periods in mid-cycle, start and stop at any moment.

    Every fourth table cannot be played, in each of eight ways: it is refused, and nothing of it is sent.
    """
    compiler = tool("gcc")
    folder = exported(tmp_path, "c")
    shutil.copy(HERE / "stress.c", folder)
    run(compiler, *STRICT, *SANITIZED, "-O1", "stress.c", "gait_player.c", "-o", "stress", cwd=folder)
    said = run(folder / "stress", 1, 1_000_000).split()
    assert said[:2] == ["1000000", "ticks,"]
    assert [
        int(number) > least for number, least in zip(said[2:10:2], (100_000, 100, 100, 40), strict=True)
    ] == 4 * [True]


@pytest.mark.parametrize(("made", "said"), MALFORMED)
def test_a_table_that_cannot_be_played_is_refused_in_python(made: tuple, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        Player(*made)


def test_what_python_refuses_c_does_not_play(library: ctypes.CDLL) -> None:
    """Only tables that C can hold: no number is a fraction or out of its type's range."""
    for made, _ in IN_ANY_LANGUAGE:
        player = CPlayer(library, *made)
        player.start(0)
        assert not player.tick(20_000)


def test_a_period_that_is_none_is_refused_while_it_walks() -> None:
    player = player_of(table())
    before = player.phase_per_us
    for period in (-1, 0.5, float("nan"), 1 << 32):
        with pytest.raises(ValueError, match="period_us: found"):
            player.set_period(period)  # type: ignore[arg-type]
    player.set_period(0)
    assert player.phase_per_us == before


def test_half_a_microsecond_is_rounded_up_in_both(library: ctypes.CDLL) -> None:
    """Half way between 1000 and 1001, in powers of two so that it is exactly half."""
    made = (2**17, 2**15, ((-1, 1000, 500, 2500, 0),), (1000, 1001))
    for player in (Player(*made), CPlayer(library, *made)):
        player.start(0)
        seen = set()
        for frame in range(100):
            player.tick(frame * 2**15)
            seen.add((frame % 4, player.pulse_us[0]) if frame >= 60 else None)
        assert len(seen - {None}) == 4
        assert sorted(pulse for _, pulse in seen - {None}) == [1000, 1001, 1001, 1001]


def test_the_gait_does_not_drift_in_hours_of_late_ticks() -> None:
    player = player_of(table())
    player.start(0)
    rng, now, began = random.Random(2), 0, 0
    while now < 10_000_000_000:
        player.tick(now % 2**32)
        if player.state == WALKING and not began:
            began = now // 20_000 * 20_000
        now += rng.randrange(1_000, 700_000)
    elapsed = (player.frame_at_us - began) % 2**32 + (now - began) // 2**32 * 2**32
    cycles = player.phase / 2**64
    assert cycles == pytest.approx(elapsed / 1e6 % 1.0, abs=1e-9)


def test_servos_are_energised_one_after_another_and_stop_where_they_start() -> None:
    player = player_of(table())
    player.start(7)
    on = {}
    for frame in range(200):
        player.tick(7 + 20_000 * frame)
        for servo, pulse in enumerate(player.pulse_us):
            if pulse:
                on.setdefault(servo, 20_000 * frame)
    assert all(on[servo] >= servo * STAGGER_US - 20_000 for servo in range(3))
    assert on[0] < on[1] < on[2]
    player.stop()
    for frame in range(200, 200 + RAMP_US // 20_000 + 8):
        player.tick(7 + 20_000 * frame)
    assert player.state == HOLDING
    assert player.pulse_us == [1000, 2000, 2000]
    player.release()
    assert (player.state, player.pulse_us) == (OFF, [0, 0, 0])


def test_a_new_period_goes_on_from_the_same_phase() -> None:
    player = player_of(table())
    player.start(0)
    for frame in range(150):
        player.tick(20_000 * frame)
    phase = player.phase
    player.set_period(500_000)
    player.tick(20_000 * 150)
    assert (player.phase - phase) % 2**64 == pytest.approx(2**64 * 0.04, rel=1e-12)


def test_every_format_names_files_that_exist() -> None:
    for name in FORMATS:
        made = files_of(name)
        assert FORMATS[name].table_file in made
        assert "README.md" in made
        assert all(made.values())
