"""Servo boards and buses: a PCA9685 and servos of three protocols, simulated, get what the player says.

Compilers that are not installed are skipped; .ci/run installs them.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st
from players import HERE, MICROPYTHON, STRICT, TEMPLATES, run, tool

from gaitopt.export.bus_packets import PROTOCOLS, Dynamixel, Feetech, crc16
from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.gait_player import HOLDING, STAGGER_US, Player
from gaitopt.export.numbering import wired
from gaitopt.export.output import PCA9685
from gaitopt.export.pca9685 import divider, pulse, setup, ticks, width_us
from gaitopt.export.replay import Replay
from gaitopt.export.stages import player_of
from gaitopt.gait.table import GaitTable
from gaitopt.problem.problem import load_problem

BUSES = ("feetech-sts", "feetech-scs", "dynamixel")


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


# --- PCA9685 ---------------------------------------------------------------------------------------


def test_the_clock_of_a_pca9685_is_the_datasheets() -> None:
    """NXP, PCA9685 Rev. 4, section 7.3.5: 200 Hz is a prescale of 30 (1Eh); 50 Hz is 121."""
    assert divider(5_000) - 1 == 30
    assert divider(20_000) - 1 == 121
    assert width_us(ticks(1500, 122), 122) == pytest.approx(1498.16)
    with pytest.raises(ValueError, match="FRAME_US: found 43000; allowed: 656 to 41943"):
        setup(43_000)


@given(st.integers(1, 65535), st.integers(656, 41_943))
def test_a_pulse_is_off_by_half_a_step_at_most(pulse_us: int, frame_us: int) -> None:
    step_us = divider(frame_us) / 25
    sent = PCA9685.rounded(pulse_us, frame_us)
    assert abs(sent - pulse_us) <= 0.5 * step_us + 1e-9 or sent == pytest.approx(4095 * step_us)
    words = pulse(3, pulse_us, frame_us)
    assert words[:3] == bytes((6 + 12, 0, 0))
    assert width_us(words[3] + 256 * words[4], divider(frame_us)) == pytest.approx(sent)


def steps_of(player: Player) -> list[int]:
    """What each output of a PCA9685 gets now, steps."""
    return [ticks(pulse_us, divider(20_000)) if pulse_us else 0 for pulse_us in player.pulse_us]


def pca9685_changes() -> Iterator[str]:
    """What the Python player gives for the commands of the mock's main.cpp, a line for each change."""
    player, last = player_of(table_for("pca9685-arduino")), [0, 0, 0]
    for ms in range(3501):
        now = (4_294_000_000 + 1000 * ms) % 2**32
        if ms == 0:
            player.start(now)
        elif ms == 2000:
            player.stop()
        elif ms == 3400:
            player.release()
        player.tick(now)
        for output, (before, steps) in enumerate(zip(last, steps_of(player), strict=True)):
            if steps != before:
                yield f"{ms} ms: {output} {steps}"
        last = steps_of(player)


@pytest.mark.parametrize("core", [2, 3])
def test_the_arduino_sketch_plays_on_a_pca9685(tmp_path: Path, core: int) -> None:
    compiler, c_compiler = tool("g++"), tool("gcc")
    folder = exported(tmp_path, "pca9685-arduino") / "gait"
    run(c_compiler, *STRICT, "-c", "gait_player.c", cwd=folder)
    run(
        compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", f"-DESP_ARDUINO_VERSION_MAJOR={core}",
        f"-I{HERE / 'mocks' / 'arduino'}", f"-I{HERE / 'mocks' / 'pca9685'}", f"-I{folder}",
        HERE / "mocks" / "pca9685" / "main.cpp", "gait_player.o", "-o", "sketch", cwd=folder,
    )  # fmt: skip
    printed = run(folder / "sketch").splitlines()
    assert printed[0] == "122 clocks a step, 400000 Hz"
    assert printed[1:] == list(pca9685_changes())


PCA9685_BOARD = """
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
    main.write_text(PCA9685_BOARD + last)
    files = [folder / f"{name}.py" for name in ("gait_table", "gait_player", "gait_servos", *names)]
    return run(node, HERE / "micropython.mjs", main, *files).splitlines()


def test_micropython_plays_on_a_pca9685(tmp_path: Path) -> None:
    folder = exported(tmp_path, "pca9685-micropython")
    printed = on_the_board(folder, "gait_servos.run(1.5)\n", ("pca9685",))
    assert printed[0] == "0 21 22 400000"
    assert printed[1:6] == ["64 253 16", "64 0 16", "64 254 121", "64 1 4", "64 0 32"]
    sent = [[int(word) for word in line.split()] for line in printed[6:]]
    assert {tuple(words[:2]) for words in sent} == {(64, 6), (64, 10), (64, 14)}
    first = [words[4] + 256 * words[5] for words in sent if words[1] == 6 and words[5] != 16]
    player = player_of(table_for("pca9685-micropython"))
    player.start(0)
    wanted = []
    for frame in range(len(first)):
        player.tick(20_000 * frame)
        if player.state and frame == 3 * STAGGER_US // 20_000 + 1 + 75:
            player.stop()
        wanted.append(steps_of(player)[0])
    assert first[:100] == wanted[:100]
    assert [words[2:] for words in sent[-3:]] == [[0, 0, 0, 16]] * 3


# --- buses -----------------------------------------------------------------------------------------


class SimulatedBus:
    """Servos on a bus: they read packets byte for byte as the makers' manuals define them.

    A packet with a wrong length or checksum raises; a servo that is not on the bus hears nothing.
    """

    def __init__(self, protocol: str, ids: list[int]) -> None:
        self.protocol = protocol
        self.registers = {id: bytearray(256) for id in ids}

    def write(self, packet: bytes) -> None:
        body = self._dynamixel(packet) if self.protocol == "dynamixel" else self._feetech(packet)
        address, size, data = body
        assert len(data) % (size + 1) == 0
        for at in range(0, len(data), size + 1):
            if data[at] in self.registers:
                self.registers[data[at]][address : address + size] = data[at + 1 : at + 1 + size]

    @staticmethod
    def _feetech(packet: bytes) -> tuple[int, int, bytes]:
        assert packet[:3] == b"\xff\xff\xfe"
        assert packet[3] == len(packet) - 4
        assert (sum(packet[2:]) & 0xFF) == 0xFF  # the checksum is the rest of the sum, inverted
        assert packet[4] == 0x83
        return packet[5], packet[6], packet[7:-1]

    @staticmethod
    def _dynamixel(packet: bytes) -> tuple[int, int, bytes]:
        assert packet[:5] == b"\xff\xff\xfd\x00\xfe"
        assert int.from_bytes(packet[5:7], "little") == len(packet) - 7
        assert crc16(packet[:-2]) == int.from_bytes(packet[-2:], "little")
        assert packet[7] == 0x83
        assert b"\xff\xff\xfd" not in packet[7:]
        return int.from_bytes(packet[8:10], "little"), int.from_bytes(packet[10:12], "little"), packet[12:-2]

    def torque(self, id: int) -> bool:
        return bool(self.registers[id][64 if self.protocol == "dynamixel" else 40])

    def position(self, id: int) -> int:
        if self.protocol == "dynamixel":
            return int.from_bytes(self.registers[id][116:120], "little")
        order = "little" if self.protocol == "feetech-sts" else "big"
        return int.from_bytes(self.registers[id][42:44], order)  # type: ignore[arg-type]


def test_packets_are_those_of_the_makers() -> None:
    """The first is the e-Manual's example of Sync Write; the others are what the makers' SDKs send.

    These are dynamixel-sdk 4.1.0 and feetech-servo-sdk 1.0.0, with `GroupSyncWrite`.
    """
    example = "ff ff fd 00 fe 11 00 83 74 00 04 00 01 96 00 00 00 02 aa 00 00 00 82 87"
    assert Dynamixel().positions([(1, 150), (2, 170)]).hex(" ") == example
    for name, packet in {
        "dynamixel": "ff ff fd 00 fe 11 00 83 74 00 04 00 01 96 00 00 00 02 e8 03 00 00 a0 af",
        "feetech-sts": "ff ff fe 0a 83 2a 02 01 96 00 02 e8 03 c4",
        "feetech-scs": "ff ff fe 0a 83 2a 02 01 00 96 02 03 e8 c4",
    }.items():
        assert PROTOCOLS[name].positions([(1, 150), (2, 1000)]).hex(" ") == packet
    assert Feetech(high_first=False).torque([3], True).hex(" ") == "ff ff fe 06 83 28 01 03 01 4b"


@pytest.mark.parametrize("name", BUSES)
@given(data=st.data())
def test_servos_on_a_bus_get_their_positions(name: str, data: st.DataObject) -> None:
    ids = data.draw(st.lists(st.integers(0, 252), min_size=1, max_size=16, unique=True))
    steps = [(id, data.draw(st.integers(0, 1023 if name == "feetech-scs" else 4095))) for id in ids]
    bus = SimulatedBus(name, ids)
    bus.write(PROTOCOLS[name].torque(ids[:1], True))
    bus.write(PROTOCOLS[name].positions(steps))
    assert [(id, bus.position(id)) for id in ids] == steps
    assert [bus.torque(id) for id in ids] == [True] + [False] * (len(ids) - 1)


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> ModuleType:
    """The driver of a bus, as it is exported, in Python."""
    folder = exported(tmp_path, request.param)
    monkeypatch.syspath_prepend(str(folder))
    for name in ("gait_table", "bus_packets", "gait_player", "gait_servos"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return importlib.import_module("gait_servos")


@pytest.mark.parametrize("modules", BUSES, indirect=True)
def test_python_plays_the_table_on_a_simulated_bus(modules: ModuleType) -> None:
    name = sys.modules["gait_table"].PROTOCOL  # type: ignore[attr-defined]
    bus, player = SimulatedBus(name, [1, 2, 3]), player_of(table_for(name))
    now, seen = 0, []

    def pause() -> None:
        nonlocal now
        now += 1_000
        seen.append([bus.position(id) if bus.torque(id) else 0 for id in (1, 2, 3)])

    modules.play(bus.write, lambda: now, pause, 2.0)
    player.start(0)
    walked, wanted = 0, []
    for ms in range(len(seen)):
        if player.tick(1000 * ms) and player.led():
            walked += 1
            if walked == 100:
                player.stop()
        wanted.append(list(player.pulse_us))
    assert player.state == HOLDING
    assert seen == wanted
    assert max(row[0] for row in seen) <= 4095
    modules.release(bus.write)
    assert not any(bus.torque(id) for id in (1, 2, 3))


@pytest.mark.parametrize("modules", ["dynamixel"], indirect=True)
def test_ctrl_c_lets_the_servos_of_a_bus_go(modules: ModuleType) -> None:
    bus, now = SimulatedBus("dynamixel", [1, 2, 3]), 0

    def pause() -> None:
        nonlocal now
        now += 10_000
        if now > 2_000_000:
            assert all(bus.torque(id) for id in (1, 2, 3))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        modules.play(bus.write, lambda: now, pause, 60.0)
    assert not any(bus.torque(id) for id in (1, 2, 3))


@pytest.mark.parametrize("name", BUSES)
def test_micropython_plays_on_a_bus(tmp_path: Path, name: str) -> None:
    printed = on_the_board(exported(tmp_path, name), "gait_servos.on_esp32(1.0)\n", ("bus_packets",))
    assert printed[0] == f"1 {PROTOCOLS[name].BAUD} 17 16"
    bus, seen = SimulatedBus(name, [1, 2, 3]), []
    for line in printed[1:]:
        bus.write(bytes(map(int, line.split())))
        seen.append(tuple(bus.position(id) if bus.torque(id) else 0 for id in (1, 2, 3)))
    player, wanted = player_of(table_for(name)), []
    player.start(0)
    for frame in range(90):
        player.tick(20_000 * frame)
        wanted.append(tuple(player.pulse_us))
    walking = [row for row in seen if all(row)]
    assert walking[:40] == [row for row in wanted if all(row)][:40]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The packets in C."""
    path = tmp_path_factory.mktemp("bus") / "bus.so"
    traps = ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
    run(tool("gcc"), *STRICT, *traps, "-O1", "-fPIC", "-shared", TEMPLATES / "bus_packets.c", "-o", path)
    loaded = ctypes.CDLL(str(path))
    loaded.bus_positions.restype = loaded.bus_torque.restype = ctypes.c_uint8
    loaded.bus_baud.restype = ctypes.c_uint32
    return loaded


@pytest.mark.parametrize(("number", "name"), list(enumerate(BUSES)))
@given(data=st.data())
def test_c_sends_the_packets_of_python(
    library: ctypes.CDLL, number: int, name: str, data: st.DataObject
) -> None:
    ids = data.draw(st.lists(st.integers(0, 252), min_size=1, max_size=16, unique=True))
    steps = [data.draw(st.integers(0, 4095)) for _ in ids]
    on = data.draw(st.booleans())
    packet = (ctypes.c_uint8 * 94)()
    made = (ctypes.c_uint8 * len(ids))(*ids)
    places = (ctypes.c_uint16 * len(ids))(*steps)
    length = library.bus_positions(number, made, places, len(ids), packet)
    assert bytes(packet[:length]) == PROTOCOLS[name].positions(list(zip(ids, steps, strict=True)))
    length = library.bus_torque(number, made, len(ids), on, packet)
    assert bytes(packet[:length]) == PROTOCOLS[name].torque(ids, on)
    assert library.bus_baud(number) == PROTOCOLS[name].BAUD


@pytest.mark.parametrize("name", BUSES)
def test_the_arduino_sketch_plays_on_a_simulated_bus(tmp_path: Path, name: str) -> None:
    folder = exported(tmp_path, f"{name}-arduino") / "gait"
    for source in ("gait_player", "bus_packets"):
        run(tool("gcc"), *STRICT, "-c", f"{source}.c", cwd=folder)
    run(
        tool("g++"), "-std=c++17", "-Wall", "-Wextra", "-Werror", "-DESP_ARDUINO_VERSION_MAJOR=3",
        f"-I{HERE / 'mocks' / 'arduino'}", f"-I{folder}", HERE / "mocks" / "bus" / "main.cpp",
        "gait_player.o", "bus_packets.o", "-o", "sketch", cwd=folder,
    )  # fmt: skip
    first, *lines = run(folder / "sketch").splitlines()
    assert first == f"{PROTOCOLS[name].BAUD} baud, 1, RX 16, TX 17"
    packets: dict[int, list[bytes]] = {}
    for line in lines:
        ms, _, numbers = line.partition(":")
        packets.setdefault(int(ms), []).append(bytes(map(int, numbers.split())))
    bus, player = SimulatedBus(name, [1, 2, 3]), player_of(table_for(f"{name}-arduino"))
    for ms in range(3501):
        now = (4_294_000_000 + 1000 * ms) % 2**32
        if ms == 0:
            player.start(now)
        elif ms == 2000:
            player.stop()
        elif ms == 3400:
            player.release()
        player.tick(now)
        for packet in packets.get(ms, []):
            bus.write(packet)
        assert [bus.position(id) if bus.torque(id) else 0 for id in (1, 2, 3)] == player.pulse_us
