"""A gait table: pulses stay within a servo's limits and near the gait, and the gait can be read back."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers import edited
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.core.errors import GaitoptError
from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.gait_player import WALKING
from gaitopt.export.replay import Replay
from gaitopt.export.stages import player_of
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Channel, Gait, write_gait
from gaitopt.gait.table import GaitTable, is_table, read_table, sampled_deg
from gaitopt.problem.problem import Problem

UNHURT = Replay(1.0, 1.0, 0.0, (0.0, 0.0), {})

shares = st.floats(0.0, 1.0)
names = st.text(min_size=1, max_size=12) | st.sampled_from(
    ['*/ system("x") //', "a\nb", '"', "\\", "??/", "'''", "{{ 7 }}", "naïve µ", "# x", "`|`", "\\u002a"]
)


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    """A wave inside -90 to 90 degrees."""
    low, high = draw(st.tuples(st.floats(-90.0, 90.0), st.floats(-90.0, 90.0)))
    return Channel(
        duty=draw(shares),
        phase=draw(st.floats(-3.0, 3.0)),
        amplitude_deg=high - low,
        offset_deg=low,
        smoothing=draw(st.just(0.0) | shares),
    )


@st.composite
def tables(draw: st.DrawFn, names: st.SearchStrategy[str] = names) -> GaitTable:
    """A table of a random gait on servos with random calibrations that reach it."""
    waves = draw(st.dictionaries(names, channels(), min_size=1, max_size=3))
    servos = {}
    for name in waves:
        servos[name] = Calibration(
            pin=draw(st.none() | st.integers(0, 20)),
            us_per_deg=draw(st.floats(5.0, 11.1)),
            direction=draw(st.sampled_from([-1, 1])),
            neutral_us=draw(st.floats(1499.0, 1501.0)),
        )
    gait = Gait(draw(st.floats(0.25, 5.0)), waves, draw(names))
    slew = draw(st.lists(st.integers(0, 500), min_size=len(waves), max_size=len(waves)))
    samples = draw(st.sampled_from([4, 7, 64, 100]))
    return GaitTable.sample(
        gait, servos, [0.0] * len(waves), 0.02, slew, draw(st.none() | st.just(2)), samples
    )


def exported(table: GaitTable, name: str, folder: Path) -> Path:
    """Write the table file of a format and return its path."""
    unset: dict[str, list[str]] = {channel: [] for channel in table.servos}
    path = folder / Path(FORMATS[name].table_file).name
    path.write_text(export_files(FORMATS[name], table, UNHURT, [], unset)[FORMATS[name].table_file])
    return path


@pytest.fixture
def made(strider: Problem) -> GaitTable:
    """The strider's first baseline, 64 samples."""
    servos = {name: channel.servo for name, channel in strider.file.channels.items()}
    return GaitTable.sample(strider.baselines["stride"], servos, [0.0, 0.0], 0.02, [0, 0])


MARKS = (
    'gaitopt-table: {"format": 1}',
    "gaitopt-table: {}",
    "gaitopt-table",
    '"gaitopt-table": {',
    "1, 2, 3",
)


@pytest.mark.parametrize("mark", MARKS)
@pytest.mark.parametrize("name", FORMATS)
def test_names_like_the_mark_of_a_table_are_names(
    made: GaitTable, name: str, mark: str, tmp_path: Path
) -> None:
    """As the name of the gait, of a channel, and in a gait's own file."""
    rear, front = made.gait.channels.values()
    gait = Gait(made.gait.period_s, {mark: rear, "front": front}, mark)
    servos = dict(zip(gait.channels, made.servos.values(), strict=True))
    table = GaitTable.sample(gait, servos, [0.0, 0.0], 0.02, [0, 0])
    path = exported(table, name, tmp_path)
    assert is_table(path)
    assert read_table(path) == table
    write_gait(tmp_path / "gait.toml", gait)
    assert not is_table(tmp_path / "gait.toml")


@given(table=tables(), name=st.sampled_from(list(FORMATS)))
def test_a_table_read_back_gives_the_gait_and_the_same_table(
    table: GaitTable, name: str, scratch: Path
) -> None:
    path = exported(table, name, scratch)
    assert is_table(path)
    read = read_table(path)
    assert read == table
    slew, start = read.slew_us, [0.0] * len(read.servos)
    again = GaitTable.sample(read.gait, read.servos, start, 0.02, slew, read.led_pin, len(read.pulses))
    assert again == table
    assert again.hash == table.hash


@given(channel=channels(), begin=st.floats(-2.0, 2.0), width=st.floats(1e-3, 1.0))
def test_the_mean_of_a_wave_is_its_integral(channel: Channel, begin: float, width: float) -> None:
    points = begin + width * (np.arange(20_000) + 0.5) / 20_000
    numeric = channel.wave(points, 0.0).mean()
    assert channel.mean_wave(np.array([begin]), width)[0] == pytest.approx(numeric, abs=2e-4)


@given(table=tables(st.text("abcdef", min_size=1, max_size=3)))
def test_the_table_errs_by_less_than_a_microsecond_beyond_interpolation(table: GaitTable) -> None:
    """The pulses against the exact samples, and their mean against the mean of the gait itself."""
    exact = sampled_deg(table.gait, len(table.pulses))
    for column, (name, servo) in enumerate(table.servos.items()):
        pulses = np.array(table.pulses)[:, column]
        wanted = np.array([servo.pulse_us(angle) for angle in exact[:, column]])
        assert np.abs(pulses - wanted).max() <= 0.5 + 1e-9
        channel = table.gait.channels[name]
        mean = channel.offset_deg + channel.amplitude_deg * channel.mean_wave(np.zeros(1), 1.0)[0]
        assert abs(pulses.mean() - servo.pulse_us(mean)) < 1.0


@given(duty=st.floats(0.2, 0.8), phase=st.floats(0.0, 1.0))
def test_interpolation_does_not_move_an_edge(duty: float, phase: float) -> None:
    """The middle of each interpolated edge is at the gait's edge, anywhere between two samples."""
    gait = Gait(1.0, {"a": Channel(duty=duty, phase=phase, amplitude_deg=1.0)})
    samples = sampled_deg(gait, 64)[:, 0]
    steps = np.diff(np.append(samples, samples[0]))
    middle = (np.arange(64) + 0.5) / 64
    for edge, sign in ((-phase, 1.0), (duty - phase, -1.0)):
        away = np.mod(middle - edge + 0.5, 1.0) - 0.5
        near = np.abs(away) < 0.05
        assert steps[near].sum() == pytest.approx(sign, abs=1e-9)
        assert (steps[near] * away[near]).sum() == pytest.approx(0.0, abs=1e-9)


@given(table=tables(st.text("abcdef", min_size=1, max_size=3)))
def test_every_tick_of_a_gait_is_within_range_and_slew(table: GaitTable) -> None:
    player = player_of(table)
    player.start(0)
    before = list(player.pulse_us)
    for frame in range(300):
        player.tick(20_000 * frame)
        for pulse, last, servo, slew in zip(
            player.pulse_us, before, table.servos.values(), table.slew_us, strict=True
        ):
            assert pulse == 0 or servo.min_us <= pulse <= servo.max_us
            assert not (pulse and last and slew) or abs(pulse - last) <= slew
        before = list(player.pulse_us)
    assert player.state == WALKING


@pytest.mark.parametrize("name", list(FORMATS))
def test_an_edited_table_is_refused(made: GaitTable, name: str, tmp_path: Path) -> None:
    path = exported(made, name, tmp_path)
    edited(
        path, "1722, 1500" if name != "csv" else "1722,1500", "1723, 1500" if name != "csv" else "1723,1500"
    )
    with pytest.raises(GaitoptError, match=r"allowed: \w{16}, as exported: it was changed since") as error:
        read_table(path)
    assert str(error.value).startswith(f"{path}: found content with hash ")


def test_another_version_is_refused(made: GaitTable, tmp_path: Path) -> None:
    path = edited(exported(made, "c", tmp_path), '"format": 1', '"format": 2')
    with pytest.raises(GaitoptError, match="format: found 2; allowed: 1: export it again"):
        read_table(path)


@pytest.mark.parametrize(
    "text",
    [
        "gaitopt-table: {",
        "gaitopt-table: {}}",
        '{"gaitopt-table": {"format": 1}}',
        '{"gaitopt-table": {}, "pulses_us": 3}',
        '// gaitopt-table: {"format": 1, "gait": 3}',
        '{"gaitopt-table": {"format": 1}, "pulses_us": [[1e999]]}',
        '{"gaitopt-table": {"format": 1}, "pulses_us": [["1_0"]]}',
        '{"gaitopt-table": {"format": 1}, "pulses_us": [[1.5]]}',
        "[" * 100_000 + '"gaitopt-table": {}',
    ],
)
def test_a_broken_table_is_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "table.h"
    path.write_text(text)
    assert is_table(path)
    with pytest.raises(GaitoptError) as error:
        read_table(path)
    assert str(error.value).startswith(f"{path}: ")


def test_windows_line_ends_and_reformatted_json_are_read(made: GaitTable, tmp_path: Path) -> None:
    path = exported(made, "c", tmp_path)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert read_table(path) == made
    path = exported(made, "json", tmp_path)
    path.write_text(json.dumps(json.loads(path.read_text()), indent=4, sort_keys=True))
    assert read_table(path).hash == made.hash
