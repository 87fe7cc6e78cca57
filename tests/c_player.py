"""The C player behind the Python player's interface, through ctypes."""

import ctypes


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
