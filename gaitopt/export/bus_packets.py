"""Packets of servo buses: Feetech STS and SCS, Dynamixel protocol 2. Runs in MicroPython and in Python alike.

One packet a frame sets the positions of all servos ("sync write"). It goes to all of them, so none answers.
"""

BROADCAST = 0xFE  # to all servos: e-Manual, Protocol 2.0, Packet ID; Feetech's protocol manual, broadcast ID
SYNC_WRITE = 0x83  # e-Manual, Protocol 2.0, Sync Write; Feetech's protocol manual, SYNC WRITE


class Feetech:
    """Feetech's protocol; registers as in the memory tables of the STS3215 and of the SCS0009.

    Args:
        high_first: whether the high byte of a position comes first, as in the SCS series (STS: low first).
    """

    BAUD = 1000000  # as delivered (memory tables, register 6, baud rate 0)
    TORQUE, POSITION = 40, 42  # torque switch, 1 byte; goal position, 2 bytes

    def __init__(self, high_first: bool) -> None:
        self.high_first = high_first

    def torque(self, ids: "list[int]", on: bool) -> bytes:
        """Return the packet that switches the torque of servos on or off."""
        return self._sync_write(self.TORQUE, 1, b"".join(bytes((id, 1 if on else 0)) for id in ids))

    def positions(self, steps: "list[tuple[int, int]]") -> bytes:
        """Return the packet that moves servos, each an ID and a position in steps."""
        data = b""
        for id, position in steps:
            low, high = position & 0xFF, position >> 8
            data += bytes((id, high, low) if self.high_first else (id, low, high))
        return self._sync_write(self.POSITION, 2, data)

    def _sync_write(self, register: int, size: int, data: bytes) -> bytes:
        # FF FF ID LENGTH INSTRUCTION REGISTER SIZE DATA CHECKSUM; the length counts from INSTRUCTION on
        body = bytes((BROADCAST, len(data) + 4, SYNC_WRITE, register, size)) + data
        return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


class Dynamixel:
    """Dynamixel protocol 2; addresses as in the control table of the X series (e-Manual, XL430-W250)."""

    BAUD = 57600  # as delivered (control table, Baud Rate(8) = 1)
    TORQUE, POSITION = 64, 116  # Torque Enable, 1 byte; Goal Position, 4 bytes

    def torque(self, ids: "list[int]", on: bool) -> bytes:
        """Return the packet that switches the torque of servos on or off."""
        return self._sync_write(self.TORQUE, 1, b"".join(bytes((id, 1 if on else 0)) for id in ids))

    def positions(self, steps: "list[tuple[int, int]]") -> bytes:
        """Return the packet that moves servos, each an ID and a position in steps."""
        data = b"".join(bytes((id, p & 0xFF, p >> 8 & 0xFF, 0, 0)) for id, p in steps)
        return self._sync_write(self.POSITION, 4, data)

    def _sync_write(self, address: int, size: int, data: bytes) -> bytes:
        # FF FF FD 00 ID LENGTH(2) INSTRUCTION ADDRESS(2) SIZE(2) DATA CRC(2); LENGTH counts from there on.
        # FF FF FD never comes in these data (IDs are at most FC), so no bytes are stuffed.
        length = len(data) + 7
        head = bytes((BROADCAST, length & 0xFF, length >> 8, SYNC_WRITE, address, 0, size, 0))
        packet = b"\xff\xff\xfd\x00" + head + data
        crc = crc16(packet)
        return packet + bytes((crc & 0xFF, crc >> 8))


def crc16(data: bytes) -> int:
    """Return the CRC of a packet: polynomial 0x8005, from 0 (e-Manual, Protocol 2.0, CRC calculation)."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


PROTOCOLS: "dict[str, Feetech | Dynamixel]" = {
    "feetech-sts": Feetech(high_first=False),
    "feetech-scs": Feetech(high_first=True),
    "dynamixel": Dynamixel(),
}
