"""Boards: their pins, and notes on some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class PinNote:
    """A note on some pins.

    Attributes:
        pins: their GPIO numbers.
        text: the note; ``{pin}`` stands for the number.
    """

    pins: Sequence[int]
    text: str


@dataclass(frozen=True)
class Board:
    """A board that sends the pulses.

    Attributes:
        name: the board or the family; in lower case what ``--board`` calls it.
        pins: the GPIO numbers that it has and that can send pulses.
        timers: pulses that it can make at once.
        led: GPIO of the LED that most of its boards have; nothing warns of this LED there.
        warnings: pins that a servo or the LED should not be on.
        wiring: the README's notes on pins that a servo may be on.
    """

    name: str
    pins: Sequence[int]
    warnings: tuple[PinNote, ...] = ()
    wiring: tuple[PinNote, ...] = ()
    timers: int = 16
    led: int | None = None

    @property
    def on_board(self) -> str:
        """Its pins in words: ``0 to 5, 12 to 19, the pins of the ESP32``."""
        pins = sorted(self.pins)
        begins = [pin for pin in pins if pin - 1 not in pins]
        ends = [pin for pin in pins if pin + 1 not in pins]
        spans = (f"{a}" if a == b else f"{a} to {b}" for a, b in zip(begins, ends, strict=True))
        return f"{', '.join(spans)}, the pins of the {self.name}"

    def warnings_of(self, pin: int | None) -> list[str]:
        """Return the warnings about a pin; none for a pin that is not set."""
        return [note.text.format(pin=pin) for note in self.warnings if pin in note.pins]

    def wiring_of(self, pins: Sequence[int | None]) -> list[str]:
        """Return the notes on the pins in use, each note once."""
        used = ((note, next((pin for pin in pins if pin in note.pins), None)) for note in self.wiring)
        return [note.text.format(pin=pin) for note, pin in used if pin is not None]


ESP32 = Board(
    name="ESP32",
    # Without 6 to 11, which belong to the flash, 20, 24 and 28 to 31, which the chip lacks, and 34 to 39,
    # which are inputs only or not on the module: ESP32-WROOM-32E datasheet, table "Pin Definitions".
    pins=(*range(6), *range(12, 20), *range(21, 24), *range(25, 28), 32, 33),
    warnings=(
        PinNote((1, 3), "GPIO{pin} of a classic ESP32 is the serial line of its USB port"),
        PinNote(
            (0, 2, 5, 12, 15),
            "GPIO{pin} of a classic ESP32 decides at reset how it boots, and a servo may pull it",
        ),
    ),
    wiring=(
        PinNote(
            (12,),
            "GPIO{pin} selects the flash voltage of a classic ESP32 at reset: nothing may pull it up then. "
            "If the board does not boot, unplug that signal wire during reset.",
        ),
    ),
    led=2,
)
"""A classic ESP32 on a module WROOM-32, which most students have. Its LEDC has 16 channels."""

ANY_ESP32 = Board(
    name="ESP32",
    pins=range(55),  # of the largest, the ESP32-P4
    warnings=(
        PinNote(range(6, 12), "GPIO{pin} belongs to the flash of a classic ESP32"),
        PinNote(range(34, 40), "GPIO{pin} of a classic ESP32 is an input only"),
    ),
    wiring=ESP32.wiring,
)
"""Any ESP32, for tables that other programs play; the notes are on the classic one."""

ESP32_S3 = Board(
    name="ESP32-S3",
    # ESP32-S3-WROOM-1 datasheet, table "Pin Definitions"; 35 to 37 are free on modules without octal PSRAM.
    pins=(*range(22), *range(35, 49)),
    warnings=(
        PinNote((19, 20), "GPIO{pin} of an ESP32-S3 is its USB port"),
        PinNote((43, 44), "GPIO{pin} of an ESP32-S3 is its serial line"),
        PinNote((35, 36, 37), "GPIO{pin} of an ESP32-S3 belongs to the octal PSRAM of modules that have it"),
        PinNote((0, 3, 45, 46), "GPIO{pin} of an ESP32-S3 decides at reset how it boots"),
    ),
    timers=8,
)
"""An ESP32-S3 on a module WROOM-1. Its LEDC has 8 channels (technical reference manual)."""

ESP32_C3 = Board(
    name="ESP32-C3",
    # ESP32-C3-MINI-1 datasheet, table "Pin Definitions": 11 to 17 belong to the flash.
    pins=(*range(11), *range(18, 22)),
    warnings=(
        PinNote((18, 19), "GPIO{pin} of an ESP32-C3 is its USB port"),
        PinNote((20, 21), "GPIO{pin} of an ESP32-C3 is its serial line"),
        PinNote((2, 8, 9), "GPIO{pin} of an ESP32-C3 decides at reset how it boots"),
    ),
    timers=6,
)
"""An ESP32-C3 on a module MINI-1. Its LEDC has 6 channels (technical reference manual)."""
