"""Servo buses: simulated servos of three protocols get what the player says.

Compilers that are not installed are skipped; .ci/run installs them.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st
from players import STRICT, TEMPLATES, mock_commands, run, sketch_prints, tool
from servo_boards import exported, on_the_board, table_for

from gaitopt.export.bus_packets import PROTOCOLS, Dynamixel, Feetech, crc16
from gaitopt.export.gait_player import HOLDING
from gaitopt.export.stages import player_of

BUSES = ("feetech-sts", "feetech-scs", "dynamixel")


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
    first, *lines = sketch_prints(exported(tmp_path, f"{name}-arduino") / "gait", "bus")
    assert first == f"{PROTOCOLS[name].BAUD} baud, 1, RX 16, TX 17"
    packets: dict[int, list[bytes]] = {}
    for line in lines:
        ms, _, numbers = line.partition(":")
        packets.setdefault(int(ms), []).append(bytes(map(int, numbers.split())))
    bus, player = SimulatedBus(name, [1, 2, 3]), player_of(table_for(f"{name}-arduino"))
    for ms, _ in mock_commands(player):
        for packet in packets.get(ms, []):
            bus.write(packet)
        assert [bus.position(id) if bus.torque(id) else 0 for id in (1, 2, 3)] == player.pulse_us
