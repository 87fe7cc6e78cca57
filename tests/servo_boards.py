"""Tables of ArcFold's gait for servo boards and buses, and the board on which MicroPython plays them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import players
from players import MICROPYTHON_CLOCK, micropython_prints

from gaitopt.export.formats import FORMATS
from gaitopt.export.numbering import wired
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
    return players.exported(folder, name, table_for(name))


BOARD = f"""{MICROPYTHON_CLOCK}

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
    files = [folder / f"{name}.py" for name in ("gait_table", "gait_player", "gait_servos", *names)]
    return micropython_prints(folder, BOARD + last, files)
