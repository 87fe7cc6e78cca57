"""`gaitopt export`: what it checks, what it replays, what it says and what it leaves behind."""

import ast
import json
import shutil
import subprocess
import tomllib
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from helpers import STRIDER, edited, still

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.core.folders import check_new_or_empty
from gaitopt.export.files import comment, export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.handover import Choices, Handover, prepare, write_folder
from gaitopt.export.limits import lags
from gaitopt.export.replay import Replay
from gaitopt.export.stages import command_stages, duty_us, sent_pulses
from gaitopt.gait.gait import Channel, Gait
from gaitopt.gait.table import GaitTable, read_table
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.start import start_targets

UNHURT = Replay(1.0, 1.0, 0.0, (0.0, 0.0), {})


def table_of(problem: Problem, gait: Gait, slew: int = 0, samples: int = 64) -> GaitTable:
    servos = {name: channel.servo for name, channel in problem.file.channels.items()}
    start = np.rad2deg(start_targets(problem)).tolist()
    frame_s = problem.file.servo.frame_s
    return GaitTable.sample(gait, servos, start, frame_s, [slew] * len(servos), None, samples)


def with_gait(gait: Gait, path: Path) -> Path:
    path.write_text(gait.to_toml())
    return path


def leaning(offset_deg: float, amplitude_deg: float) -> Gait:
    """A strider's gait whose rear leg goes where it is told."""
    return Gait(
        0.5,
        {
            "rear": Channel(duty=0.5, phase=0.75, amplitude_deg=amplitude_deg, offset_deg=offset_deg),
            "front": Channel(duty=0.5, phase=0.0, amplitude_deg=20.0),
        },
    )


# --- the command ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(FORMATS))
def test_every_format_is_written_and_read_back(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    out = tmp_path / "deep" / "out"
    command = ["export", wired_folder, "stride", "--format", name, "--out", out, "--led-pin", 2, "--json"]
    assert main([str(part) for part in command]) == 0
    answer = json.loads(capsys.readouterr().out)
    written = sorted(path for path in out.rglob("*") if path.is_file())
    assert sorted(answer["files"]) == [str(path) for path in written]
    assert sorted(path.name for path in out.parent.iterdir()) == ["out"]
    problem = load_problem(wired_folder)
    table = out / FORMATS[name].table_file
    assert read_table(table).hash == answer["hash"]
    assert problem.find_gait(str(table)) == problem.baselines["stride"]
    assert answer["from_datasheet"]["rear"][0] == "neutral_us"
    assert answer["ideal_speed_m_s"] > 0.0
    assert answer["loss"] == pytest.approx(1.0 - answer["replayed_speed_m_s"] / answer["ideal_speed_m_s"])
    assert main(["simulate", str(wired_folder), str(table), "--json"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert main(["simulate", str(wired_folder), "stride", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == one


def test_the_same_export_twice_is_the_same_bytes(wired: Problem, serial: Executor) -> None:
    made = [prepare(wired, wired.baselines["stride"], Choices("c"), serial).files for _ in range(2)]
    assert made[0] == made[1]


def test_what_is_said_without_json(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["export", str(wired_folder), "square", "--format", "csv", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "rear: from the datasheet, not measured: neutral_us, min_us," in said
    assert "rear: the servo falls up to 30° and 0.049 s behind" in said
    assert "mm/s as the servos will get it: a loss of" in said
    assert str(out / "table.csv") in said


@pytest.mark.parametrize(
    ("change", "said"),
    {
        "no pin": (("--format", "arduino"), "channels.rear.servo.pin: missing; this format drives the pins"),
        "slew": (
            ("--format", "c", "--slew", "sevro"),
            "--slew: speed: found 'sevro'; allowed: off, servo, or",
        ),
        "negative slew": (
            ("--format", "c", "--slew", "-3"),
            "--slew: speed: found '-3'; allowed: off, servo",
        ),
        "samples": (("--format", "c", "--samples", "3"), "--samples: found 3; allowed: 4 to 1024"),
    }.values(),
)
def test_a_wrong_request_is_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, ...], said: str
) -> None:
    out = tmp_path / "out"
    assert main(["export", str(STRIDER), "stride", "--out", str(out), *change]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_folder_in_use_is_refused_before_anything_runs(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("keep")
    assert main(["export", str(wired_folder), "stride", "--format", "c", "--out", str(out)]) == 1
    assert (
        capsys.readouterr().err == f"gaitopt: --out: {out} is not empty; allowed: a new or an empty folder\n"
    )
    assert [path.name for path in out.iterdir()] == ["mine.txt"]
    with pytest.raises(GaitoptError, match="is a file; allowed"):
        check_new_or_empty(out / "mine.txt")


def test_a_write_that_fails_half_way_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(GaitoptError, match="cannot be written"):
        write_folder(out, {"fine.txt": "x", "a/b/c.txt": "the parent of b is not made"})
    assert list(tmp_path.iterdir()) == []
    out.mkdir()
    assert write_folder(out, {"a/b.txt": "x"}) == [out / "a" / "b.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


# --- limits ---------------------------------------------------------------------------------------


def test_a_gait_outside_the_range_is_refused_with_channel_time_value_and_limit(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gait = with_gait(leaning(20.0, -80.0), tmp_path / "far.toml")
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


# --- the replay -----------------------------------------------------------------------------------


def test_the_last_stage_is_what_the_player_sends_one_frame_late(wired: Problem) -> None:
    table = table_of(wired, wired.baselines["stride"])
    time = np.arange(0, 3000) * 1e-3
    played = command_stages(wired, table)["player"](time)
    sent = np.array(sent_pulses(table, 150))
    for frame in (0, 1, 77, 148):
        pulses = duty_us(sent[frame], 20_000)
        wanted = [
            np.deg2rad(servo.angle_deg(pulse))
            for servo, pulse in zip(table.servos.values(), pulses, strict=True)
        ]
        rows = played[20 * (frame + 1) : 20 * (frame + 2)]
        np.testing.assert_allclose(rows, np.tile(wanted, (20, 1)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(played[:20], 0.0, atol=np.deg2rad(0.06))


def test_the_stages_add_one_thing_at_a_time(wired: Problem) -> None:
    stages = command_stages(wired, table_of(wired, wired.baselines["stride"]))
    time = 2.0 + np.arange(1000) * 1e-3
    rows = {name: np.rad2deg(commands(time)) for name, commands in stages.items()}
    half_steps_deg = 0.5 * (1.0 + 20_000 / 2**14) / 11.1
    assert np.abs(rows["interpolation"] - rows["gait"]).max() < 0.5
    assert np.abs(rows["quantisation"] - rows["interpolation"]).max() <= half_steps_deg
    np.testing.assert_array_equal(rows["frame rate"], np.repeat(rows["quantisation"][::20], 20, axis=0))
    np.testing.assert_array_equal(rows["latency"][20:], rows["frame rate"][:-20])
    assert np.abs(rows["player"] - rows["latency"]).max() <= 2.0 * half_steps_deg


def test_a_few_samples_lose_speed_and_interpolation_is_named(quick: Problem, serial: Executor) -> None:
    """With four samples a square wave becomes a triangle."""
    handover = prepare(quick, quick.baselines["square-1s"], Choices("c", samples=4), serial)
    warning = handover.replay.warning
    assert handover.replay.loss is not None
    assert abs(handover.replay.loss) > 0.05
    assert warning in handover.warnings
    assert set(handover.replay.causes) == {
        "interpolation",
        "quantisation",
        "frame rate",
        "latency",
        "ramp and slew clamp",
    }
    assert sum(handover.replay.causes.values()) == pytest.approx(handover.replay.loss)


def test_a_slow_slew_clamp_is_named_as_the_cause(quick: Problem, serial: Executor) -> None:
    handover = prepare(quick, quick.baselines["square-1s"], Choices("c", slew="60"), serial)
    assert handover.table.slew_us == (13, 13, 13)
    assert handover.replay.loss is not None
    assert handover.replay.loss > 0.2
    assert "most of it by ramp and slew clamp (" in str(handover.replay.warning)


def test_the_servos_own_speed_is_the_clamp_that_servo_asks_for(quick: Problem, serial: Executor) -> None:
    handover = prepare(quick, quick.baselines["square-2s"], Choices("json", slew="servo"), serial)
    assert handover.table.slew_us == (133, 133, 133)


def test_a_gait_that_stands_still_has_no_loss_to_tell(wired: Problem, serial: Executor) -> None:
    played = prepare(wired, still(wired), Choices("json"), serial).replay
    assert played.ideal_m_s == pytest.approx(0.0, abs=1e-3)
    assert played.causes == {}
    assert "does not go forward" in str(played.warning) or "scatter" in str(played.warning)


# --- names ----------------------------------------------------------------------------------------


def hostile(wired_folder: Path, name: str) -> Problem:
    """The strider with a servo of another name."""
    text = (wired_folder / "strider.xml").read_text()
    quoted = name.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;").replace("\n", "&#10;")
    (wired_folder / "strider.xml").write_text(text.replace('name="rear"', f'name="{quoted}"'))
    path = wired_folder / "problem.toml"
    content = tomllib.loads(path.read_text())
    content["channels"] = {
        name if key == "rear" else key: value for key, value in content["channels"].items()
    }
    for baseline in content["baselines"].values():
        baseline["channels"] = {
            name if key == "rear" else key: value for key, value in baseline["channels"].items()
        }
    path.write_text(tomli_w.dumps(content))
    return load_problem(path)


@pytest.mark.parametrize(
    "name",
    ['*/ system("x") //', "a\\nimport os", '"); system("x"); //', "\\", "??/", "{{ 7 * 7 }}", "|`<b>", "ü"],
)
def test_a_name_stays_a_name(wired_folder: Path, tmp_path: Path, name: str) -> None:
    problem = hostile(wired_folder, name)
    table = table_of(problem, problem.baselines["stride"])
    unset: dict[str, list[str]] = {name: [], "front": []}
    texts = {form: export_files(FORMATS[form], table, UNHURT, [], unset) for form in FORMATS}
    program = ast.parse(texts["micropython"]["gait_table.py"])
    assert {type(statement) for statement in program.body} == {ast.Assign}
    assert comment(name)[1:-1] in texts["c"]["README.md"]
    for form, files in texts.items():
        path = tmp_path / f"{form}.txt"
        path.write_text(files[FORMATS[form].table_file])
        assert list(problem.find_gait(str(path)).channels) == [name, "front"]
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    write_folder(tmp_path / "c", texts["c"])
    (tmp_path / "c" / "user.c").write_text(
        '#include "table.h"\nint main(void) { return gait_table.servos - 2; }\n'
    )
    strict = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-pedantic"]
    subprocess.run([compiler, *strict, "user.c", "gait_player.c"], cwd=tmp_path / "c", check=True)


def test_the_readme_has_wiring_the_lines_to_type_and_how_to_film(wired: Problem, serial: Executor) -> None:
    handover: Handover = prepare(wired, wired.baselines["stride"], Choices("micropython", led_pin=2), serial)
    text = handover.files["README.md"]
    for part in (
        "| 4 | `rear` | 1500 | 500 to 2500 | neutral_us, min_us,",
        "import gait_servos\ngait_servos.run(20)",
        "Sync LED: GPIO2",
        "scale bar",
        "square to the path",
        "Three repeats",
        "gaitopt import walk.csv --sync-at S",
        f"hash `{handover.table.hash}`",
    ):
        assert part in text
