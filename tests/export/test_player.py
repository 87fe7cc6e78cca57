"""The exported player: C, Python and MicroPython send the same pulses, within every servo's limits.

Compilers and emulators that are not installed are skipped; .ci/run installs them.
"""

import ctypes
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gaitopt.export.gait_player as gait_player
from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.gait_player import HOLDING, OFF, RAMP_US, STAGGER_US, WALKING, Player
from gaitopt.export.replay import Replay
from gaitopt.export.stages import player_of, sent_pulses
from gaitopt.gait.table import GaitTable
from gaitopt.problem.problem import load_problem

HERE = Path(__file__).parent / "player"
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


# --- one table and one script, everywhere ---------------------------------------------------------


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


def files_of(name: str) -> dict[str, str]:
    """Return the files of a format, as if the replay had shown no loss."""
    return export_files(
        FORMATS[name], table(), Replay(1.0, 1.0, 0.0, (0.0, 0.0), {}), [], {key: [] for key in table().servos}
    )


def exported(folder: Path, name: str) -> Path:
    """Write the files of a format."""
    for path, text in files_of(name).items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    return folder


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
    """What the Python player, which the replay in simulation uses, makes of the script."""
    sys.modules.setdefault("gait_player", gait_player)
    sys.path.insert(0, str(HERE))
    try:
        from play_script import lines
    finally:
        sys.path.remove(str(HERE))
    return "".join(f"{line}\n" for line in lines(player_of(table()), script()))


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
    node = tool("node")
    if not MICROPYTHON.is_dir():
        pytest.skip(f"MicroPython as WebAssembly is not installed: npm install --prefix {HERE}")
    folder = with_script(exported(tmp_path, "micropython"))
    main = folder / "main.py"
    main.write_text(
        "import gait_table as t\n"
        "from gait_player import Player\n"
        "from play_script import lines\n"
        "from script import STEPS\n"
        "player = Player(t.PERIOD_US, t.FRAME_US, t.SERVOS, t.PULSES_US)\n"
        "for line in lines(player, STEPS):\n"
        "    print(line)\n"
    )
    files = [folder / name for name in ("gait_table.py", "gait_player.py", "script.py")]
    assert run(node, HERE / "micropython.mjs", main, *files, HERE / "play_script.py") == expected()


def test_the_micropython_driver_walks_stops_and_lets_go(tmp_path: Path) -> None:
    """In MicroPython, on a board of 3 pins whose clock wraps at 2^30 as the ESP32's does."""
    node = tool("node")
    if not MICROPYTHON.is_dir():
        pytest.skip(f"MicroPython as WebAssembly is not installed: npm install --prefix {HERE}")
    folder = exported(tmp_path, "micropython")
    main = folder / "main.py"
    main.write_text(MICROPYTHON_BOARD)
    files = [folder / f"{name}.py" for name in ("gait_table", "gait_player", "gait_servos")]
    printed = run(node, HERE / "micropython.mjs", main, *files).splitlines()
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


MICROPYTHON_BOARD = """
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


class Clock:
    now = (1 << 30) - 500000

    def ticks_us(self):
        self.now += 100
        return self.now % (1 << 30)

    def ticks_diff(self, one, other):
        return (one - other + (1 << 29)) % (1 << 30) - (1 << 29)

    def sleep_ms(self, ms):
        self.now += 1000 * ms


machine = Module()
machine.Pin, machine.PWM = Pin, PWM
sys.modules["machine"], sys.modules["time"] = machine, Clock()
import gait_servos

gait_servos.run(2)
"""


# --- drivers against mocks ------------------------------------------------------------------------


@pytest.mark.parametrize("core", [2, 3])
def test_the_arduino_sketch_plays_on_both_cores(tmp_path: Path, core: int) -> None:
    compiler, c_compiler = tool("g++"), tool("gcc")
    folder = exported(tmp_path, "arduino") / "gait"
    run(c_compiler, *STRICT, "-c", "gait_player.c", cwd=folder)
    run(
        compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", f"-DESP_ARDUINO_VERSION_MAJOR={core}",
        f"-I{HERE / 'mocks' / 'arduino'}", f"-I{folder}", HERE / "mocks" / "arduino" / "main.cpp",
        "gait_player.o", "-o", "sketch", cwd=folder,
    )  # fmt: skip
    printed = run(folder / "sketch").splitlines()
    assert printed[0] == "50 Hz, 14 bits"
    assert printed[1:] == changes(arduino_duties())


def arduino_duties() -> Iterator[tuple[int, dict[int, int]]]:
    """What the Python player gives for the commands of the mock's main.cpp, by ms and GPIO."""
    player = player_of(table())
    pins = [servo[0] for servo in player.servos]
    held: dict[int, int] = {}
    for ms in range(3501):
        now = (4_294_000_000 + 1000 * ms) % 2**32
        if ms == 0:
            player.start(now)
        elif ms == 2000:
            player.stop()
        elif ms == 3400:
            player.release()
        if player.tick(now):
            duties = [gait_player.duty(pulse, 20_000) for pulse in player.pulse_us]
            held = dict(zip(pins, duties, strict=True)) | {2: 100_000 * player.led()}
        yield ms, held


def changes(rows: Iterator[tuple[int, dict[int, int]]]) -> list[str]:
    last: dict[int, int] = {}
    lines = []
    for ms, row in rows:
        for pin in sorted(row):
            if row[pin] != last.get(pin, 0):
                lines.append(f"{ms} ms: GPIO{pin} {row[pin]}")
        last = row
    return lines


def test_the_esp_idf_component_plays(tmp_path: Path) -> None:
    compiler = tool("gcc")
    folder = exported(tmp_path, "esp-idf")
    mocks = HERE / "mocks" / "esp-idf"
    run(
        compiler, *STRICT, *SANITIZED, f"-I{mocks}", f"-I{folder}", mocks / "main.c", "gait_servos.c",
        "gait_player.c", "-o", "app", cwd=folder,
    )  # fmt: skip
    printed = run(folder / "app").splitlines()
    assert printed[:5] == [
        "50 Hz, 14 bits",
        "channel 0 GPIO12",
        "channel 1 GPIO13",
        "channel 2 GPIO14",
        "GPIO2 mode 2",
    ]
    played = [line for line in printed[5:] if line.startswith(("channel 0 ", "GPIO2 1"))]
    waiting = played.index("GPIO2 1") - 1
    duties = [int(line.split()[2]) for line in played if line.startswith("channel")]
    walked = [gait_player.duty(row[0], 20_000) for row in sent_pulses(table(), len(duties) - waiting)]
    assert duties[waiting:] == walked


# --- properties -----------------------------------------------------------------------------------


class CServo(ctypes.Structure):
    _fields_ = [
        ("pin", ctypes.c_int16),
        ("start_us", ctypes.c_uint16),
        ("min_us", ctypes.c_uint16),
        ("max_us", ctypes.c_uint16),
        ("slew_us", ctypes.c_uint16),
    ]


class CTable(ctypes.Structure):
    _fields_ = [
        ("hash", ctypes.c_uint32),
        ("period_us", ctypes.c_uint32),
        ("frame_us", ctypes.c_uint32),
        ("samples", ctypes.c_uint16),
        ("servos", ctypes.c_uint16),
        ("led_pin", ctypes.c_int16),
        ("servo", ctypes.POINTER(CServo)),
        ("pulse_us", ctypes.POINTER(ctypes.c_uint16)),
    ]


class CPlayerState(ctypes.Structure):
    _fields_ = [
        ("table", ctypes.POINTER(CTable)),
        ("state", ctypes.c_int),
        ("phase", ctypes.c_uint64),
        ("phase_per_us", ctypes.c_uint64),
        ("ramp_us", ctypes.c_uint32),
        ("energised_us", ctypes.c_uint32),
        ("frame_at_us", ctypes.c_uint32),
        ("pulse_us", ctypes.c_uint16 * 16),
    ]


class CPlayer:
    """The C player behind the Python player's interface."""

    def __init__(self, library: ctypes.CDLL, period: int, frame: int, servos: tuple, pulses: tuple):
        self.library, self.frame_us = library, frame
        rows = (CServo * len(servos))(*(CServo(*row) for row in servos))
        values = (ctypes.c_uint16 * len(pulses))(*pulses)
        count = len(servos)
        self.table = CTable(0, period, frame, len(pulses) // count, count, -1, rows, values)
        self.player = CPlayerState()
        self.library.gait_init(ctypes.byref(self.player), ctypes.byref(self.table))

    def _call(self, name: str, *arguments: int) -> int:
        values = [ctypes.c_uint32(value) for value in arguments]
        return getattr(self.library, f"gait_{name}")(ctypes.byref(self.player), *values)

    def start(self, now: int) -> None:
        self._call("start", now)

    def stop(self) -> None:
        self._call("stop")

    def release(self) -> None:
        self._call("release")

    def set_period(self, period: int) -> None:
        self._call("set_period", period)

    def tick(self, now: int) -> bool:
        return bool(self._call("tick", now) & 1)

    @property
    def state(self) -> int:
        return int(self.player.state)

    @property
    def pulse_us(self) -> list[int]:
        return list(self.player.pulse_us[: self.table.servos])


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

    Every fourth table cannot be played, in each of eight ways: it is refused, and nothing is ever sent of it.
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
"""Tables that nobody can play, and what a player says of each."""


@pytest.mark.parametrize(("made", "said"), MALFORMED)
def test_a_table_that_cannot_be_played_is_refused_in_python(made: tuple, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        Player(*made)


def test_a_table_that_cannot_be_played_is_refused_in_micropython(tmp_path: Path) -> None:
    node = tool("node")
    if not MICROPYTHON.is_dir():
        pytest.skip(f"MicroPython as WebAssembly is not installed: npm install --prefix {HERE}")
    folder = exported(tmp_path, "micropython")
    main = folder / "main.py"
    tables = ", ".join(re.sub(r"\b(nan|inf)\b", r"float('\1')", repr(made)) for made, _ in MALFORMED)
    main.write_text(
        "from gait_player import Player\n"
        f"for made in ({tables}):\n"
        "    try:\n"
        "        Player(*made)\n"
        "    except ValueError as error:\n"
        "        print(error)\n"
    )
    printed = run(node, HERE / "micropython.mjs", main, folder / "gait_player.py").splitlines()
    assert printed == [said for _, said in MALFORMED]


def test_what_python_refuses_c_does_not_play(library: ctypes.CDLL) -> None:
    """Those that C can be given at all: no number of them is a fraction, or out of its type's range."""
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
