"""Tables of ArcFold's gait for servo boards and buses, and the board on which MicroPython plays them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from players import HERE, MICROPYTHON, run, tool

from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.numbering import wired
from gaitopt.export.replay import Replay
from gaitopt.gait.table import GaitTable
from gaitopt.problem.problem import load_problem


@cache
def table_for(name: str) -> GaitTable:
    """ArcFold's 1 s gait on the output of a format, with a sync LED."""
    output = FORMATS[name].output
    problem = wired(load_problem("arcfold"), output)
    servos = {name: channel.servo for name, channel in problem.file.channels.items()}
    gait = problem.baselines["square-1s"]
    return GaitTable.sample(gait, servos, [0.0] * 3, 0.02, [40, 0, 0], led_pin=2, unit=output.unit)


def exported(folder: Path, name: str) -> Path:
    """Write the files of a format."""
    replay, unset = Replay(1.0, 1.0, 0.0, (0.0, 0.0), {}), {key: [] for key in table_for(name).servos}
    for path, text in export_files(FORMATS[name], table_for(name), replay, [], unset).items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    return folder


BOARD = """
import sys


class Module:
    pass


class Pin:
    OUT = 1

    def __init__(self, pin, mode=None, value=0):
        self.pin = pin

    def value(self, level):
        pass


class I2C:
    def __init__(self, id, sda, scl, freq):
        print(id, sda.pin, scl.pin, freq)

    def writeto(self, address, words):
        print(address, " ".join(str(word) for word in words))


class Clock:
    now = (1 << 30) - 500000

    def ticks_us(self):
        self.now += 100
        return self.now % (1 << 30)

    def ticks_diff(self, one, other):
        return (one - other + (1 << 29)) % (1 << 30) - (1 << 29)

    def sleep_ms(self, ms):
        self.now += 1000 * ms


class UART:
    def __init__(self, id, baudrate, tx, rx):
        print(id, baudrate, tx, rx)

    def write(self, words):
        print(" ".join(str(word) for word in words))


machine = Module()
machine.Pin, machine.I2C, machine.UART = Pin, I2C, UART
sys.modules["machine"], sys.modules["time"] = machine, Clock()
import gait_servos

"""


def on_the_board(folder: Path, last: str, names: tuple[str, ...]) -> list[str]:
    """What MicroPython prints on a board with an I2C bus and a UART whose clock wraps at 2^30."""
    node = tool("node")
    if not MICROPYTHON.is_dir():
        pytest.skip(f"MicroPython as WebAssembly is not installed: npm install --prefix {HERE}")
    main = folder / "main.py"
    main.write_text(BOARD + last)
    files = [folder / f"{name}.py" for name in ("gait_table", "gait_player", "gait_servos", *names)]
    return run(node, HERE / "micropython.mjs", main, *files).splitlines()
