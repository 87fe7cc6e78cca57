"""Logs of servos: CSV tables and JSON lines become commands and angles."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hostility import refused, within
from servologs import followed, targets

from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import Imported, import_file
from gaitopt.diagnose.record.trial import Series

TIME = np.round(np.arange(0.0, 3.0, 0.02), 2)
SENT = np.round(targets(TIME), 5)
SEEN = np.round(followed(TIME, SENT), 5)
MAPPED = ImportOptions(commands={"servo": "target_rad"}, signals={"joint.arm": "angle_rad"})
EPOCH = 1_700_000_000


def table(head: str, *columns: Series, delimiter: str = ",", decimal: str = ".") -> str:
    """A table of text; NaN is blank."""
    rows = [
        delimiter.join("" if math.isnan(value) else f"{value:.10g}".replace(".", decimal) for value in row)
        for row in zip(*columns, strict=True)
    ]
    return "\n".join([head, *rows]) + "\n"


def lines(make: Callable[[float, float, float], dict]) -> str:
    """JSON lines: what `make` returns of the time, the command and the angle of each row."""
    rows = zip(TIME.tolist(), SENT.tolist(), SEEN.tolist(), strict=True)
    return "".join(json.dumps(make(*row)) + "\n" for row in rows)


def imported(folder: Path, text: str, options: ImportOptions | None = None) -> Imported:
    """The recording in a file of this text."""
    path = folder / "log.txt"
    path.write_text(text, encoding="utf-8")
    return import_file(path, options or ImportOptions())


def check(recording: Imported, program: str, column: str = "arm_rad") -> None:
    """Check that a recording has the commands and the angle of this file."""
    assert recording.program == program
    assert recording.sent is not None
    assert list(recording.sent.columns) == [column]
    assert list(recording.signals) == ["joint.arm"]
    np.testing.assert_allclose(recording.time, TIME, atol=1e-6)
    np.testing.assert_allclose(recording.sent.time, TIME, atol=1e-6)
    np.testing.assert_allclose(recording.sent.columns[column], SENT, atol=1e-5)
    np.testing.assert_allclose(recording.signals["joint.arm"], SEEN, atol=1e-5)


DEGREES = (1e3 * TIME, np.rad2deg(SENT), np.rad2deg(SEEN))


@pytest.mark.parametrize(
    "text",
    [
        table("t_s,target.arm_rad,arm_rad", TIME, SENT, SEEN),
        table("timestamp,target_arm_rad,joint.arm_rad", TIME, SENT, SEEN),
        table("joint.arm_rad,cmd_arm_rad,time_us", SEEN, SENT, 1e6 * TIME),
        table("time_ns,goal_position.arm_rad,present_position.arm_rad", 1e9 * TIME, SENT, SEEN),
        table("t_ms;target.arm_deg;arm_deg", *DEGREES, delimiter=";", decimal=","),
        table("t_ms\taction.arm_deg\tposition.arm_deg", *DEGREES, delimiter="\t"),
        table("t_s,volts,target.arm_rad,target.arm_temperature,arm_rad", TIME, TIME, SENT, TIME, SEEN),
    ],
)
def test_a_table_whose_columns_say_what_they_hold(tmp_path: Path, text: str) -> None:
    text = text.replace("target.arm_temperature", "arm_temperature")
    check(imported(tmp_path, text), "plain CSV")


@pytest.mark.parametrize(
    "make",
    [
        lambda t, sent, seen: {"t_s": t, "target.arm_rad": sent, "arm_rad": seen},
        lambda t, sent, seen: {"t": t, "target": {"arm_rad": sent}, "joint": {"arm_rad": seen}, "ok": True},
        lambda t, sent, seen: {
            "time_ms": 1e3 * t,
            "command_rad": {"arm": sent},
            "position_rad": {"arm": seen},
        },
        lambda t, sent, seen: {
            "mode": "position",
            "timestamp": EPOCH + t,
            "goal_position": {"arm_deg": math.degrees(sent)},
            "present_position": {"arm_deg": math.degrees(seen), "load": 3},
        },
        lambda t, sent, seen: {"ts": int(1e3 * EPOCH + 1e3 * t), "cmd_arm_rad": sent, "state.arm_rad": seen},
        lambda t, sent, seen: {
            "timestamp": EPOCH * 10**9 + round(1e9 * t),
            "action": {"arm_rad": sent},
            "observation": {"state": {"arm_rad": seen}},
        },
    ],
)
def test_json_lines(tmp_path: Path, make: Callable[[float, float, float], dict]) -> None:
    check(imported(tmp_path, lines(make)), "JSON lines")
    head = '{"robot": "arm", "rate_hz": 50}\n\n'
    check(imported(tmp_path, head + lines(make)), "JSON lines")


def test_columns_are_chosen_by_name(tmp_path: Path) -> None:
    text = table("t_s,target_rad,angle_rad,spare_rad", TIME, SENT, SEEN, SEEN)
    check(imported(tmp_path, text, MAPPED), "plain CSV", "servo_rad")
    said = refused(lambda: imported(tmp_path, text))
    asked = "--command CHANNEL=target_rad --signal joint.NAME=angle_rad"
    assert said.endswith(f"columns do not say whose they are; say it: {asked}")
    text = lines(lambda t, sent, seen: {"t": t, "a": {"goal": [9.0, sent]}, "b": {"now": [9.0, seen]}})
    chosen = ImportOptions(commands={"arm": "a.goal.1"}, signals={"joint.arm": "b.now.1"}, angle_unit="rad")
    check(imported(tmp_path, text, chosen), "JSON lines")


def test_a_column_that_was_asked_for_is_taken_once(tmp_path: Path) -> None:
    text = table("t_s,soll_rad,arm_rad", TIME, SENT, SEEN)
    check(imported(tmp_path, text, ImportOptions(commands={"arm": "soll_rad"})), "plain CSV")


def test_columns_that_say_only_angle_are_a_joint_where_nothing_is_commanded(tmp_path: Path) -> None:
    assert list(imported(tmp_path, table("t_s,angle_rad", TIME, SEEN)).signals) == ["joint.angle"]


def test_units_of_columns_that_have_none(tmp_path: Path) -> None:
    text = lines(lambda t, sent, seen: {"t": t, "target": {"arm": sent}, "joint": {"arm": seen}})
    said = refused(lambda: imported(tmp_path, text))
    assert "joint.arm: its unit is not known; say it: --angle-unit rad, deg, counts, normalised" in said
    check(imported(tmp_path, text, ImportOptions(angle_unit="rad")), "JSON lines")
    for unit, scale, options in (
        ("deg", math.radians(1.0), {}),
        ("normalised", math.radians(1.35), {"full_scale_deg": {"": 135.0}}),
        ("normalised", math.radians(0.5), {"full_scale_deg": {"": 135.0, "arm": 50.0}}),
    ):
        recording = imported(tmp_path, text, ImportOptions(angle_unit=unit, **options))
        assert recording.sent is not None
        np.testing.assert_allclose(recording.signals["joint.arm"], scale * SEEN)
        np.testing.assert_allclose(recording.sent.columns["arm_rad"], scale * SENT)
    said = refused(lambda: imported(tmp_path, text, ImportOptions(angle_unit="normalised")))
    assert "say which angle is 100: --full-scale-deg DEG, or --full-scale-deg arm=DEG" in said


def test_counts_of_an_encoder(tmp_path: Path) -> None:
    counts = np.round(2048 + SEEN / (2.0 * np.pi) * 4096)
    text = table("t_s,target.arm_counts,arm_counts", TIME, 2048 + SENT / (2.0 * np.pi) * 4096, counts)
    recording = imported(tmp_path, text)
    assert recording.sent is not None
    np.testing.assert_allclose(recording.signals["joint.arm"], SEEN, atol=0.0008)
    np.testing.assert_allclose(recording.sent.columns["arm_rad"], SENT, atol=1e-6)
    half = imported(tmp_path, text, ImportOptions(counts_per_turn=8192.0))
    np.testing.assert_allclose(half.signals["joint.arm"], (counts - 4096.0) * 2.0 * np.pi / 8192.0)


def test_pulse_widths_stay_pulse_widths(tmp_path: Path) -> None:
    pulses = 1500.0 + 500.0 * SENT
    pulses[100:] = np.nan
    recording = imported(tmp_path, table("t_s,target.arm_us,arm_rad", TIME, pulses, SEEN))
    assert recording.sent is not None
    np.testing.assert_allclose(recording.sent.columns["arm_us"], pulses)
    said = refused(lambda: imported(tmp_path, table("t_s,cmd.arm_us,arm_rad", TIME, 1e5 + TIME, SEEN)))
    assert "cmd.arm_us: found 100000; allowed: pulse widths from 0 to 20000 µs" in said


@pytest.mark.parametrize("blank", ["", "nan", "null"])
def test_a_blank_command_is_an_unpowered_servo(tmp_path: Path, blank: str) -> None:
    sent = np.where(TIME < 1.0, SENT, np.nan)
    text = table("t_s,target.arm_rad,arm_rad", TIME, sent, SEEN).replace(",,", f",{blank},")
    recording = imported(tmp_path, text)
    assert recording.sent is not None
    np.testing.assert_array_equal(recording.sent.columns["arm_rad"], sent)
    assert len(recording.time) == len(TIME)


def test_rows_of_either_commands_or_angles(tmp_path: Path) -> None:
    """A command holds until the next one; a blank cell says nothing where no row has both."""
    changed = np.flatnonzero(np.append(1.0, np.diff(SENT)))
    rows = [(f"{TIME[i]:.3f}", f"{SENT[i]}", "") for i in changed]
    rows += [(f"{t + 0.003:.3f}", "", f"{seen}") for t, seen in zip(TIME, SEEN, strict=True)]
    text = "\n".join(
        ["t_s,target.arm_rad,arm_rad", *map(",".join, sorted(rows, key=lambda row: float(row[0])))]
    )
    recording = imported(tmp_path, text)
    assert recording.sent is not None
    np.testing.assert_allclose(recording.sent.time, TIME[changed])
    np.testing.assert_allclose(recording.sent.columns["arm_rad"], SENT[changed])
    np.testing.assert_allclose(recording.time, TIME + 0.003)
    np.testing.assert_allclose(recording.signals["joint.arm"], SEEN)
    assert recording.defects == ()


def test_json_lines_of_one_thing_each(tmp_path: Path) -> None:
    """Two channels that are commanded now and then: a row has what both hold. Null is no power."""
    said = [
        {"t": 0.0, "cmd": {"a_rad": 0.1}},
        {"t": 0.1, "cmd": {"b_rad": 0.2}},
        {"t": 0.5, "cmd": {"a_rad": None}},
    ]
    told = [{"t": 0.02 * i + 0.001, "joint": {"a_rad": 0.01 * i**0.5, "b_rad": 0.0}} for i in range(50)]
    text = "\n".join(map(json.dumps, sorted(said + told, key=lambda line: line["t"])))
    recording = imported(tmp_path, text)
    assert recording.sent is not None
    np.testing.assert_allclose(recording.sent.time, [0.1, 0.5])
    np.testing.assert_array_equal(recording.sent.columns["a_rad"], [0.1, np.nan])
    np.testing.assert_array_equal(recording.sent.columns["b_rad"], [0.2, 0.2])
    assert recording.time[0] == pytest.approx(0.101)
    late = next(defect for defect in recording.defects if defect.name == "late_commands")
    assert "5 samples before t = 0.10 s left out: not every channel has a command there" in late.message


def test_of_commands_at_one_time_the_last_one_holds(tmp_path: Path) -> None:
    time = TIME.copy()
    time[40] = time[41]
    recording = imported(tmp_path, table("t_s,target.arm_rad,arm_rad", time, np.arange(150.0), SEEN))
    assert recording.sent is not None
    assert (np.diff(recording.sent.time) > 0.0).all()
    assert 40.0 not in recording.sent.columns["arm_rad"]
    assert {defect.name for defect in recording.defects} == {"doubled_stamps"}


def test_a_clock_that_counts_from_1970_begins_at_zero(tmp_path: Path) -> None:
    text = table("timestamp_ms,target.arm_rad,arm_rad", 1e3 * TIME, SENT, SEEN)
    rows = [line.split(",", 1) for line in text.splitlines()]
    text = "\n".join(
        [",".join(rows[0]), *(f"{EPOCH * 1000 + round(float(t))},{rest}" for t, rest in rows[1:])]
    )
    recording = imported(tmp_path, text)
    check(recording, "plain CSV")
    (defect,) = recording.defects
    assert (defect.name, recording.zero_s) == ("clock_zero", EPOCH)


def test_a_clock_that_was_set_back_once_is_named_with_its_line(tmp_path: Path) -> None:
    time = np.where(TIME >= 1.5, TIME - 0.4, TIME)
    recording = imported(tmp_path, table("t_s,target.arm_rad,arm_rad", time, SENT, SEEN))
    check(recording, "plain CSV")
    (defect,) = recording.defects
    assert defect.name == "clock_set_back"
    assert "the clock goes backward by 0.38 s at line 77 (t = 1.48 s)" in defect.message
    assert defect.parameters == pytest.approx({"back_s": 0.38, "line": 77.0})
    text = lines(
        lambda t, sent, seen: {"t": t if t < 1.5 else t - 0.4, "cmd": {"arm_rad": sent}, "arm_rad": seen}
    )
    (defect,) = imported(tmp_path, '{"head": 1}\n' + text).defects
    assert "at line 77" in defect.message


ROW = '{"t": 1, "cmd.a_rad": 0.1, "a_rad": 0.2}\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("t_s,target.a_rad,a_rad\n", "no numbers under the column names"),
        ("t_s,target.a_rad,a_rad\n0,0,0\n1,0,0\n", "fewer than three samples"),
        (
            "t_s,target.a_rad\n0,0\n1,0\n2,0\n",
            "no column such as x_m or mid_left_rad; it has t_s, target.a_rad",
        ),
        (
            "t_s,target.a_rad,a_rad\n0,0,0\n1,0,0\n0.5,0,0\n0.1,1,1\n",
            "time goes backward 2 times, first at line 4",
        ),
        (
            "t_s,target.a_rad,a_rad\n0,0,0\n1,0,0\n3,0,0\n2,1,1\n4,1,1\n5,1,1\n6,1,1\n7,1,1\n",
            "line 5 is out of order; sort the lines",
        ),
        ("t_s,target.a_rad,a_rad\n0,0,0\n1,x,0\n2,0,0\n", "line 3, column target.a_rad: found 'x'"),
        ("t,target.a_rad,a_rad\n0,0,0\n20,0,0\n40,0,0\n", "samples are 20 s apart if they are seconds"),
        ("t_s,target.a_rad,cmd.a_deg,a_rad\n0,0,0,0\n", "'target.a_rad' and 'cmd.a_deg' are both of 'a'"),
        (
            "t_s,target.a_rad,a_rad,a_deg\n0,0,0,0\n",
            "'a_rad' and 'a_deg' are both of 'joint.a'; choose one: --signal",
        ),
        ('t_s,"target.a,b_rad",a_rad\n0,0,0\n', "found 'a,b'; allowed: a name without commas"),
        ("t_s,target.a_rad,a_rad\n0,0,\n1,0,\n2,0,\n", "fewer than three samples"),
        (ROW + "{", "line 2: not JSON: "),
        (ROW + "[1]\n", "line 2: found [1]; allowed: one object a line"),
        ("[" + ROW + "]", "line 1: not JSON: "),
        (ROW + '{"t": 2, "t": 3}\n', "line 2: key 't' appears twice"),
        (ROW + '{"t": 2, "b.a": 1, "b": {"a": 3}}\n', "line 2: key 'b.a' appears twice"),
        (ROW + '{"t": 2, "a_rad": Infinity}\n', "line 2, a_rad: found inf; allowed: a number or null"),
        (ROW + '{"t": 2, "a_rad": 1e999}\n', "line 2, a_rad: found inf; allowed: a number or null"),
        (ROW + '{"t": 2, "a_rad": 1' + 400 * "0" + "}\n", "line 2, a_rad: found 1000"),
        (ROW + '{"t": 2, "a_rad": 1' + 5000 * "0" + "}\n", "line 2: not JSON: "),
        (ROW + '{"t": 2, "a_rad": "fast"}\n', "line 2, a_rad: found 'fast'; allowed: a number or null"),
        (ROW + '{"t": 2, "a_rad": true}\n', "line 2, a_rad: found True; allowed: a number or null"),
        (ROW + '{"t": 2, "a_rad": 1e13}\n', "line 2, a_rad: found 10000000000000.0"),
        (ROW + '{"t": null, "a_rad": 1}\n', "1 time stamps are missing"),
        (ROW + '{"a_rad": 0.2}\n', "line 2: a_rad without a time stamp, t"),
        (
            ROW.replace('"t"', '"when"'),
            "no time stamps; allowed: a key such as t_s or timestamp, with a number",
        ),
        (ROW.replace('"a_rad"', '"a\\u001b[2J_rad"'), "allowed: a name without commas, quotes and control"),
        (
            ROW + '{"t": 2, "b": ' + 20 * "[" + "1" + 20 * "]" + "}\n",
            "line 2: nested too deep; allowed: at most 8",
        ),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path: Path, text: str, said: str) -> None:
    assert said in refused(lambda: imported(tmp_path, text))


ENDLESS = {
    "found 2000017 characters": lambda: ROW + '{"t": 2, "b": "' + 2_000_000 * "x" + '"}\n',
    "found 5000001 lines; allowed: at most 5000000": lambda: "{}\n" * 5_000_001,
    "nested too deep": lambda: ROW + 100_000 * "[" + "\n",
    "at most 20000000 numbers under 10000 keys": lambda: "".join(
        f'{{"t": {i}, "k{i}_rad": 1}}\n' for i in range(10_001)
    ),
    "found 180000000 numbers": lambda: "".join(
        f'{{"t": {i}, "k{i % 9000}_rad": 1}}\n' for i in range(20_000)
    ),
}


@pytest.mark.parametrize("said", ENDLESS)
def test_a_log_without_end_is_one_line_in_time(tmp_path: Path, said: str) -> None:
    with within(60):
        assert said in refused(lambda: imported(tmp_path, ENDLESS[said]()))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ImportOptions(commands={"a": "goal_rad"}),
            "--command a: unknown column 'goal_rad'; known: target_rad, ",
        ),
        (ImportOptions(signals={"joint.a": "anglerad"}), "unknown column 'anglerad'"),
        (ImportOptions(signals={"arm": "angle_rad"}), "--signal: found 'arm'; allowed: joint.NAME, marker.x"),
        (
            ImportOptions(angle_unit="grad"),
            "--angle-unit: found 'grad'; allowed: rad, deg, normalised, counts, us",
        ),
        (ImportOptions(counts_per_turn=0.0), "--counts-per-turn: found 0.0"),
        (ImportOptions(full_scale_deg={"": math.nan}), "--full-scale-deg: found nan"),
        (
            ImportOptions(commands={"a": "target_rad"}, signals={"marker.x": "angle_rad"}),
            "the unit m, cm, mm",
        ),
    ],
)
def test_one_line_says_which_option_is_wrong(tmp_path: Path, options: ImportOptions, said: str) -> None:
    text = table("t_s,target_rad,angle_rad", TIME, SENT, SEEN)
    assert said in refused(lambda: imported(tmp_path, text, options))


def test_a_site_is_measured_beside_joints(tmp_path: Path) -> None:
    text = table("t_s,target.a_rad,site.tip.x_mm,site.tip.yaw_deg,arm_rad", TIME, SENT, SEEN, SEEN, SEEN)
    recording = imported(tmp_path, text)
    assert list(recording.signals) == ["site.tip.x", "site.tip.yaw", "joint.arm"]
    np.testing.assert_allclose(recording.signals["site.tip.x"], 1e-3 * SEEN)
    np.testing.assert_allclose(recording.signals["site.tip.yaw"], np.deg2rad(SEEN))
