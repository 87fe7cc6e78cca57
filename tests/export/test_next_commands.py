"""The player of the next commands: rows at their time, a log of what was sent, and servos that are let go.

MicroPython as WebAssembly is skipped where it is not installed; .ci/run installs it.
"""

from __future__ import annotations

import ast
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st
from players import MICROPYTHON_CLOCK, micropython_prints

from gaitopt.diagnose.judge.command_experiment import CommandExperiment
from gaitopt.diagnose.judge.command_score import Separation
from gaitopt.diagnose.judge.command_search import ScoredCommands, travel_of
from gaitopt.diagnose.record.commands import read_commands
from gaitopt.export.command_player import CommandPlayer
from gaitopt.export.next_commands import next_command_files, write_next_commands
from gaitopt.gait.command_shapes import SHAPES, Size, shaped
from gaitopt.gait.played_commands import PlayedCommands
from gaitopt.problem.problem import Problem, load_problem

SHAPE = {shape.name: shape for shape in SHAPES}
NAME = 'a"b,c'


def problem(folder: Path, servos: dict[str, dict[str, object]]) -> Problem:
    """A problem with some servos; its model is not needed."""
    folder.mkdir()
    (folder / "rig.xml").write_text("<mujoco/>")
    fidelity = {"timestep_s": 1e-3, "integrator": "implicitfast"}
    content = {
        "name": "bench",
        "roles": {},
        "channels": {name: {"range_deg": [-60.0, 60.0], "servo": servo} for name, servo in servos.items()},
        "simulation": {"working": fidelity, "reference": fidelity},
    }
    (folder / "problem.toml").write_text(tomli_w.dumps(content))
    return load_problem(folder)


def experiment(of: Problem, shape: str = "drop", share: float = 0.5) -> CommandExperiment:
    """What a choice of commands might have been."""
    size = Size(share, SHAPE[shape].times_s[0], (0,))
    made = shaped(SHAPE[shape], size, travel_of(of))
    assert made is not None
    played = PlayedCommands.of(made.commands, {n: b.servo for n, b in of.file.channels.items()})
    apart = Separation(np.array([[0.0, 4.2], [4.2, 0.0]]), np.array([0.5, 0.5]), ~np.eye(2, dtype=bool))
    chosen = ScoredCommands(made, played, apart)
    return CommandExperiment(chosen, (), ("dead `band`", "stiction"), 1.5, (), {"arm": 600.0})


@pytest.fixture
def wired(tmp_path: Path) -> Problem:
    """Two calibrated servos with pins."""
    servos = {"arm": {"pin": 12, "neutral_us": 1500}, "wrist": {"pin": 13, "us_per_deg": 10.0}}
    return problem(tmp_path / "wired", servos)


@pytest.fixture
def modules(wired: Problem, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The written player as Python modules."""
    write_next_commands(Path(), wired, experiment(wired))
    monkeypatch.syspath_prepend(str(Path("next-player").resolve()))
    import play_commands

    yield play_commands
    for name in ("play_commands", "command_table", "command_player"):
        del sys.modules[name]


def test_the_run_folder_gets_a_table_and_a_player(wired: Problem) -> None:
    found = experiment(wired)
    write_next_commands(Path(), wired, found)
    names = ("README.md", "command_player.py", "command_table.py", "play_commands.py")
    assert {str(path) for path in Path().rglob("*.*")} == {"next.csv", *(f"next-player/{n}" for n in names)}
    assert read_commands(Path("next.csv"), wired).commands_key == found.played.commands.commands_key
    readme = Path("next-player/README.md").read_text()
    assert "drop of 30 degrees on arm" in readme
    assert "4.2 floors (the best commands so far: 1.5)" in readme
    assert "needs a switch in its supply" in readme
    assert "| `wrist` | us | 1500 | 1500 | 13 | neutral_us, min_us" in readme


def test_the_table_has_the_rows_of_the_log(wired: Problem) -> None:
    found = experiment(wired)
    table: dict[str, object] = {}
    for node in ast.parse(next_command_files(wired, found)["next-player/command_table.py"]).body:
        assert isinstance(node, ast.Assign)
        table[ast.unparse(node.targets[0])] = ast.literal_eval(node.value)
    assert table["ROWS"] == found.played.rows
    assert table["PINS"] == (12, 13)
    assert (table["ROW_US"], table["FRAME_US"]) == (20_000, 20_000)
    assert table["HEAD"] == "t_s,arm_us,wrist_us"


def test_a_name_stays_a_name_in_the_player(tmp_path: Path) -> None:
    named = problem(tmp_path / "named", {NAME: {"neutral_us": 1500}})
    files = next_command_files(named, experiment(named))
    line = next(node for node in ast.parse(files["next-player/command_table.py"]).body)
    assert isinstance(line, ast.Assign)
    assert ast.literal_eval(line.value) == 't_s,"a""b,c_us"'
    assert files["next.csv"].splitlines()[0] == 't_s,"a""b,c_us"'


def test_servos_without_calibration_are_played_in_rad(tmp_path: Path) -> None:
    bare = problem(tmp_path / "bare", {"arm": {}})
    files = next_command_files(bare, experiment(bare))
    assert files["next.csv"].startswith("t_s,arm_rad\n0.0,0.0\n")
    assert "cannot be played on the pins of an ESP32" in files["next-player/README.md"]
    assert "on_esp32()" not in files["next-player/README.md"]


@given(st.lists(st.integers(0, 50_000), max_size=200), st.integers(0, 2**32 - 1))
def test_rows_are_on_the_grid_whatever_the_calls(steps: list[int], begin: int) -> None:
    rows = tuple((index,) for index in range(40))
    player = CommandPlayer(rows, 20_000)
    player.start(begin)
    passed, sent = 0, []
    for step in [0, *steps]:
        passed += step
        if player.tick((begin + passed) % 2**32):
            assert player.cells() == rows[passed // 20_000]
            assert player.at_us == passed
            sent.append(player.row)
        assert player.done() == (passed >= 800_000)
    assert sent == sorted(set(sent))
    assert sent[0] == 0


@pytest.mark.parametrize(
    ("rows", "row_us", "said"),
    [
        ((), 20_000, "ROWS: found none"),
        (((),), 20_000, "ROWS: found none"),
        (((1,), (1, 2)), 20_000, "ROWS: found a row of 2 cells; allowed: 1"),
        (((1,),), 0, "ROW_US: found 0; allowed: a whole number above 0"),
        (((1,),), 2e4, "ROW_US: found 20000.0"),
    ],
)
def test_what_cannot_be_played_is_refused(rows: tuple[tuple[int, ...]], row_us: int, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        CommandPlayer(rows, row_us)


def test_python_plays_and_logs_what_was_sent(modules: ModuleType, wired: Problem) -> None:
    now, sent = 2**32 - 1_000_000, []

    def clock() -> int:
        return now % 2**32

    def pause() -> None:
        nonlocal now
        now += 1_300

    lines = modules.play(sent.append, clock, pause, lambda: (0.5,), ("elbow_rad",))
    Path("played.csv").write_text("\n".join(lines) + "\n")
    assert lines[0] == "t_s,arm_us,wrist_us,elbow_rad"
    log, table = read_commands(Path("played.csv"), wired), experiment(wired).played
    rows = [tuple(cells) for cells in sent]
    assert rows[:2] == [(1500, None), (1500, 1500)]
    assert rows[2:] == list(table.rows)
    assert np.array_equal(log.rows, table.commands.rows, equal_nan=True)
    late = log.first_s + log.time - table.commands.time
    assert 0.0 <= late.min() <= late.max() < 0.0014


def test_a_board_needs_pins_and_pulses(modules: ModuleType) -> None:
    table = sys.modules["command_table"]
    table.PINS = (12, None)  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="PINS: found None"):
        modules._check()
    table.UNITS = ("rad", "us")  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="UNITS: found rad"):
        modules._check()


def on_the_board(folder: Path, last: str) -> list[str]:
    """What MicroPython prints that plays on a board of 2 pins whose clock wraps at 2^30."""
    files = [folder / f"{name}.py" for name in ("command_table", "command_player", "play_commands")]
    return micropython_prints(folder, BOARD + last, files)


def test_micropython_plays_the_same_and_holds_the_last_row(wired: Problem) -> None:
    found = experiment(wired, "step", -0.5)
    write_next_commands(Path(), wired, found)
    printed = on_the_board(Path("next-player").resolve(), "print(play_commands.on_esp32()[-1])\n")
    sent = [int(line.split()[1]) for line in printed if line.startswith("12 ")]
    rows = [1000 * row[0] for row in found.played.rows if row[0] is not None]
    assert sent[:3] == [0, 1_500_000, 1_500_000]
    assert sent[3:] == rows
    stamp, arm, wrist = printed[-1].split(",")
    assert (arm, wrist) == ("1500", "1500")
    assert math.isclose(float(stamp), found.played.commands.time[-1], abs_tol=2e-3)


def test_micropython_lets_go_on_ctrl_c_and_at_release(wired: Problem) -> None:
    write_next_commands(Path(), wired, experiment(wired))
    folder = Path("next-player").resolve()
    stopped = on_the_board(folder, STOP)
    assert stopped[-3:] == ["12 0", "12 0", "stopped"]
    assert stopped.count("13 0") >= 2
    ended = on_the_board(folder, "play_commands.on_esp32(log=None)\nprint('end')\nplay_commands.release()\n")
    assert ended[ended.index("end") + 1 :] == ["13 0", "13 0", "12 0", "12 0"]
    assert "13 1500000" in ended[: ended.index("end")][-2:]


STOP = """
def read():
    raise KeyboardInterrupt
try:
    play_commands.on_esp32(read)
except KeyboardInterrupt:
    print("stopped")
"""

BOARD = f"""{MICROPYTHON_CLOCK}

import sys


class Module:
    pass


class Pin:
    def __init__(self, pin):
        self.pin = pin


class PWM:
    def __init__(self, pin, freq, duty_ns):
        self.pin = pin.pin
        self.duty_ns(duty_ns)

    def duty_ns(self, width):
        print(self.pin, width)

    def deinit(self):
        print(self.pin, 0)


machine = Module()
machine.Pin, machine.PWM = Pin, PWM
sys.modules["machine"], sys.modules["time"] = machine, Clock()
import play_commands

"""
