"""The exported player: C, RISC-V, MicroPython and Python send the same pulses, tick for tick.

Compilers and emulators that are not installed are skipped; .ci/run installs them.
"""

import re
import shutil
from pathlib import Path

import pytest
from players import (
    HERE,
    MALFORMED,
    MICROPYTHON_CLOCK,
    RV32,
    RV32_BOARD,
    SANITIZED,
    STRICT,
    expected,
    exported,
    micropython_prints,
    run,
    table,
    tool,
    with_script,
)

from gaitopt.export.gait_player import STAGGER_US
from gaitopt.export.stages import sent_pulses


@pytest.fixture
def c_folder(tmp_path: Path) -> Path:
    """The c export with the test's program and script beside it."""
    folder = with_script(exported(tmp_path, "c"))
    shutil.copy(HERE / "trace.c", folder)
    return folder


def test_the_script_passes_through_every_state() -> None:
    states = {line.split()[2] for line in expected().splitlines()}
    assert states == {"0", "1", "2", "3", "4"}


def test_c_equals_python_tick_for_tick(c_folder: Path) -> None:
    compiler = tool("gcc")
    run(compiler, *STRICT, *SANITIZED, "trace.c", "gait_player.c", "-o", "trace", cwd=c_folder)
    assert run(c_folder / "trace") == expected()


def test_every_exported_c_file_compiles_alone_without_include_paths(tmp_path: Path) -> None:
    compiler = tool("gcc")
    folder = exported(tmp_path, "c")
    assert {path.name for path in folder.iterdir()} == {
        "table.h",
        "gait_player.h",
        "gait_player.c",
        "README.md",
    }
    (folder / "user.c").write_text(
        '#include "table.h"\nint main(void)\n{\n    return (int)gait_table.servos - 3;\n}\n'
    )
    for source in ("gait_player.c", "user.c"):
        run(compiler, *STRICT, "-c", source, cwd=folder)
    run(compiler, "gait_player.o", "user.o", "-o", "user", cwd=folder)
    run(folder / "user")


def test_rv32imc_under_qemu_equals_the_host_byte_for_byte(c_folder: Path) -> None:
    compiler, emulator, host = tool("riscv64-unknown-elf-gcc"), tool("qemu-system-riscv32"), tool("gcc")
    run(compiler, *STRICT, *RV32, *RV32_BOARD, "trace.c", "gait_player.c", "-o", "trace.elf", cwd=c_folder)
    run(host, *STRICT, "trace.c", "gait_player.c", "-o", "trace", cwd=c_folder)
    board = ["-machine", "virt", "-bios", "none", "-display", "none", "-semihosting"]
    assert run(emulator, *board, "-kernel", c_folder / "trace.elf") == run(c_folder / "trace")


def test_rv32imc_takes_less_than_2_kb_with_the_table(c_folder: Path) -> None:
    compiler, sizes = tool("riscv64-unknown-elf-gcc"), tool("riscv64-unknown-elf-size")
    (c_folder / "keep.c").write_text(
        '#include "table.h"\nconst gait_table_t *the_table(void);\n'
        "const gait_table_t *the_table(void)\n{\n    return &gait_table;\n}\n"
    )
    run(compiler, *STRICT, *RV32, "-c", "gait_player.c", "keep.c", cwd=c_folder)
    rows = run(sizes, "gait_player.o", "keep.o", cwd=c_folder).splitlines()[1:]
    assert sum(int(row.split()[3]) for row in rows) < 2048


def test_micropython_equals_c_and_python_tick_for_tick(tmp_path: Path) -> None:
    folder = with_script(exported(tmp_path, "micropython"))
    main = (
        "import gait_table as t\n"
        "from gait_player import Player\n"
        "from play_script import lines\n"
        "from script import STEPS\n"
        "player = Player(t.PERIOD_US, t.FRAME_US, t.SERVOS, t.PULSES_US)\n"
        "for line in lines(player, STEPS):\n"
        "    print(line)\n"
    )
    files = [folder / name for name in ("gait_table.py", "gait_player.py", "script.py")]
    printed = micropython_prints(folder, main, [*files, HERE / "play_script.py"])
    assert printed == expected().splitlines()


def test_the_micropython_driver_walks_stops_and_lets_go(tmp_path: Path) -> None:
    """In MicroPython, on a board of 3 pins whose clock wraps at 2^30 as the ESP32's does."""
    folder = exported(tmp_path, "micropython")
    files = [folder / f"{name}.py" for name in ("gait_table", "gait_player", "gait_servos")]
    printed = micropython_prints(folder, MICROPYTHON_BOARD, files)
    frames = [line.split() for line in printed if line.startswith("13 ")]
    assert "50 Hz on 12, 13, 14" in printed
    widths = [int(width) for _, width in frames]
    assert widths[:2] == [0, 0]
    assert widths.index(2_000_000) == STAGGER_US // 20_000 + 1
    assert widths[-3:] == [2_000_000, 0, 0]
    walked = sent_pulses(table(), 60)
    begin = printed.index("led 1") + 1
    at_led = [line.split() for line in printed[:begin] if line.startswith("12 ")][-1]
    assert int(at_led[1]) == 1000 * walked[0][0]
    assert printed.count("led 1") == 100


MICROPYTHON_BOARD = f"""{MICROPYTHON_CLOCK}

import sys


class Module:
    pass


class Pin:
    OUT = 1

    def __init__(self, pin, mode=0, value=0):
        self.pin = pin

    def value(self, level):
        print("led", level)


class PWM:
    pins = []

    def __init__(self, pin, freq, duty_ns):
        self.pin = pin.pin
        self.freq = freq
        PWM.pins.append(self.pin)
        if len(PWM.pins) == 3:
            print(freq, "Hz on", ", ".join(str(pin) for pin in PWM.pins))
        self.duty_ns(duty_ns)

    def duty_ns(self, width):
        print(self.pin, width)

    def deinit(self):
        print(self.pin, 0)


machine = Module()
machine.Pin, machine.PWM = Pin, PWM
sys.modules["machine"], sys.modules["time"] = machine, Clock()
import gait_servos

gait_servos.run(2)
"""


def test_a_table_that_cannot_be_played_is_refused_in_micropython(tmp_path: Path) -> None:
    folder = exported(tmp_path, "micropython")
    tables = ", ".join(re.sub(r"\b(nan|inf)\b", r"float('\1')", repr(made)) for made, _ in MALFORMED)
    main = (
        "from gait_player import Player\n"
        f"for made in ({tables}):\n"
        "    try:\n"
        "        Player(*made)\n"
        "    except ValueError as error:\n"
        "        print(error)\n"
    )
    printed = micropython_prints(folder, main, [folder / "gait_player.py"])
    assert printed == [said for _, said in MALFORMED]
