"""One gait table and one script of a player's clock, for the players of every language."""

import random
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest

from gaitopt.export import gait_player
from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.replay import Replay
from gaitopt.export.stages import player_of
from gaitopt.gait.table import GaitTable
from gaitopt.problem.problem import load_problem

HERE = Path(__file__).parent / "export" / "player"
TEMPLATES = Path(gait_player.__file__).parent / "templates"
MICROPYTHON = HERE / "node_modules" / "@micropython" / "micropython-webassembly-pyscript"
STRICT = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-pedantic"]
SANITIZED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
RV32 = ["-march=rv32imc", "-mabi=ilp32", "--specs=picolibc.specs", "-Os"]
RV32_BOARD = [
    "--oslib=semihost",
    "--crt0=hosted",
    *(
        f"-Wl,--defsym=__{name}={value}"
        for name, value in {
            "flash": "0x80000000",
            "flash_size": "0x200000",
            "ram": "0x80200000",
            "ram_size": "0x200000",
        }.items()
    ),
]
Script = list[tuple[str, int]]


def tool(name: str) -> str:
    """Return the path of an installed program, or skip the test."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    return path


def run(*command: object, cwd: Path | None = None) -> str:
    """Run a command that must succeed and return all that it prints."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@cache
def table() -> GaitTable:
    """ArcFold's 1 s gait, slew-limited on one servo, with a sync LED."""
    problem = load_problem("arcfold")
    gait = problem.baselines["square-1s"]
    servos = {name: channel.servo for name, channel in problem.file.channels.items()}
    return GaitTable.sample(gait, servos, [0.0, 0.0, 0.0], 0.02, [133, 0, 0], led_pin=2)


@cache
def script() -> Script:
    """Three thousand steps across the clock's wrap: jitter, pauses, stops, restarts, other periods."""
    rng = random.Random(1)
    now = 2**32 - 2_000_000
    steps: Script = [("t", now), ("g", now)]
    for _ in range(3000):
        now = (now + rng.choice([0, 1, 3_000, 19_999, 20_000, 20_001, rng.randrange(60_000)])) % 2**32
        steps.append(("t", now))
        if rng.random() < 0.02:
            what = rng.choice("gsrpggP")
            if what == "P":
                now = (now + rng.choice([3_000_000, 2**31, 2**32 - 1])) % 2**32
                continue
            value = rng.choice([0, 1, 250_000, 333_333, 5_000_000, 2**32 - 1]) if what == "p" else now
            steps.append((what, value))
    return steps


def files_of(name: str, made: GaitTable | None = None) -> dict[str, str]:
    """Return the files of a format for a table, by default `table`, as if the replay had shown no loss."""
    made = made or table()
    unset: dict[str, list[str]] = {servo: [] for servo in made.servos}
    return export_files(FORMATS[name], made, Replay(1.0, 1.0, 0.0, (0.0, 0.0), {}), [], unset)


def exported(folder: Path, name: str, made: GaitTable | None = None) -> Path:
    """Write the files of a format for a table, by default `table`."""
    for path, text in files_of(name, made).items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    return folder


def sketch_prints(folder: Path, mock: str, core: int = 3) -> list[str]:
    """What an exported Arduino sketch prints that the main.cpp of a mock runs, compiled for a core."""
    compiler, c_compiler, mocks = tool("g++"), tool("gcc"), HERE / "mocks"
    for source in folder.glob("*.c"):
        run(c_compiler, *STRICT, "-c", source.name, cwd=folder)
    run(
        compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", f"-DESP_ARDUINO_VERSION_MAJOR={core}",
        f"-I{mocks / 'arduino'}", f"-I{mocks / mock}", f"-I{folder}", mocks / mock / "main.cpp",
        *folder.glob("*.o"), "-o", "sketch", cwd=folder,
    )  # fmt: skip
    return run(folder / "sketch").splitlines()


def mock_commands(player: gait_player.Player) -> Iterator[tuple[int, bool]]:
    """Give a player the commands of the mocks' `mock_at`; yield each ms, and whether a frame began."""
    for ms in range(3501):
        now = (4_294_000_000 + 1000 * ms) % 2**32
        if ms == 0:
            player.start(now)
        elif ms == 2000:
            player.stop()
        elif ms == 3400:
            player.release()
        yield ms, player.tick(now)


MICROPYTHON_CLOCK = """
class Clock:
    now = (1 << 30) - 500000

    def ticks_us(self):
        self.now += 100
        return self.now % (1 << 30)

    def ticks_diff(self, one, other):
        return (one - other + (1 << 29)) % (1 << 30) - (1 << 29)

    def sleep_ms(self, ms):
        self.now += 1000 * ms
"""
"""The module `time` of a board whose clock wraps at 2^30 as the ESP32's does."""


def micropython_prints(folder: Path, main: str, files: Sequence[Path]) -> list[str]:
    """What a program prints in MicroPython that may import some files; skip the test without MicroPython."""
    node = tool("node")
    if not MICROPYTHON.is_dir():
        pytest.skip(f"MicroPython as WebAssembly is not installed: npm install --prefix {HERE}")
    (folder / "main.py").write_text(main)
    return run(node, HERE / "micropython.mjs", folder / "main.py", *files).splitlines()


def with_script(folder: Path) -> Path:
    """Write the script as C and as Python."""
    rows = ",\n".join(f"    {{'{what}', {value}u}}" for what, value in script())
    (folder / "script.h").write_text(
        "#include <stdint.h>\nstatic const struct {\n    char what;\n    uint32_t value;\n} "
        f"script[] = {{\n{rows},\n}};\n"
    )
    (folder / "script.py").write_text(f"STEPS = {tuple(script())!r}\n")
    return folder


@cache
def expected() -> str:
    """The answer of the Python player, which the replay in simulation uses, to the script."""
    sys.modules.setdefault("gait_player", gait_player)
    sys.path.insert(0, str(HERE))
    try:
        from play_script import lines
    finally:
        sys.path.remove(str(HERE))
    return "".join(f"{line}\n" for line in lines(player_of(table()), script()))


GOOD = (-1, 1500, 500, 2500, 0)
IN_ANY_LANGUAGE = [
    ((0, 20_000, (GOOD,), (1500,)), "PERIOD_US: found 0; allowed: 1 to 4294967295"),
    ((1_000_000, 0, (GOOD,), (1500,)), "FRAME_US: found 0; allowed: 1 to 4294967295"),
    ((1_000_000, 20_000, ((-1, 1500, 0, 2500, 0),), (1500,)), "SERVOS: min: found 0; allowed: 1 to 2500"),
    ((1_000_000, 20_000, ((-1, 1500, 9, 8, 0),), (1500,)), "SERVOS: min: found 9; allowed: 1 to 8"),
    ((1_000_000, 20_000, (GOOD,), ()), "PULSES_US: number of rows: found 0; allowed: 1 to 65535"),
]
MALFORMED = [
    *IN_ANY_LANGUAGE,
    ((float("nan"), 20_000, (GOOD,), (1500,)), "PERIOD_US: found nan; allowed: 1 to 4294967295"),
    ((1 << 32, 20_000, (GOOD,), (1500,)), "PERIOD_US: found 4294967296; allowed: 1 to 4294967295"),
    ((1_000_000, 2e4, (GOOD,), (1500,)), "FRAME_US: found 20000.0; allowed: 1 to 4294967295"),
    ((1_000_000, 20_000, (), (1500,)), "SERVOS: number of them: found 0; allowed: 1 to 16"),
    ((1_000_000, 20_000, 17 * (GOOD,), 17 * (1500,)), "SERVOS: number of them: found 17; allowed: 1 to 16"),
    (
        (1_000_000, 20_000, (GOOD[:4],), (1500,)),
        "SERVOS: found a row of 4; allowed: pin, start, min, max, slew",
    ),
    ((1_000_000, 20_000, ((None, *GOOD[1:]),), (1500,)), "SERVOS: pin: found None; allowed: -32768 to 32767"),
    ((1_000_000, 20_000, ((-1, -9, 500, 2500, 0),), (1500,)), "SERVOS: start: found -9; allowed: 0 to 65535"),
    (
        (1_000_000, 20_000, ((-1, 1500, 9, 70_000, 0),), (1500,)),
        "SERVOS: max: found 70000; allowed: 1 to 65535",
    ),
    (
        (1_000_000, 20_000, ((-1, 1500, 500, 2500, -1),), (1500,)),
        "SERVOS: slew: found -1; allowed: 0 to 65535",
    ),
    ((1_000_000, 20_000, (GOOD, GOOD), (1500, 1600, 1700)), "PULSES_US: found 3 pulses; allowed: rows of 2"),
    ((1_000_000, 20_000, (GOOD,), (1500, -1)), "PULSES_US: found -1; allowed: 0 to 65535"),
    ((1_000_000, 20_000, (GOOD,), (1500, float("inf"))), "PULSES_US: found inf; allowed: 0 to 65535"),
    ((1_000_000, 20_000, (GOOD,), ("1500",)), "PULSES_US: found '1500'; allowed: 0 to 65535"),
]
"""Tables that cannot be played, and the message of a player for each."""
