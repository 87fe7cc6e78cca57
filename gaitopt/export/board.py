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
        name: the board or the family.
        pins: the GPIO numbers that it has.
        warnings: pins that a servo or the LED should not be on.
        wiring: the README's notes on pins that a servo may be on.
    """

    name: str
    pins: range
    warnings: tuple[PinNote, ...] = ()
    wiring: tuple[PinNote, ...] = ()

    def warnings_of(self, pin: int | None) -> list[str]:
        """Return the warnings about a pin; none for a pin that is not set."""
        return [note.text.format(pin=pin) for note in self.warnings if pin in note.pins]

    def wiring_of(self, pins: Sequence[int | None]) -> list[str]:
        """Return the notes on the pins in use, each note once."""
        used = ((note, next((pin for pin in pins if pin in note.pins), None)) for note in self.wiring)
        return [note.text.format(pin=pin) for note, pin in used if pin is not None]


ESP32 = Board(
    name="ESP32",
    pins=range(55),  # of the largest, the ESP32-P4; the classic one has 0 to 39
    warnings=(
        PinNote(range(6, 12), "GPIO{pin} belongs to the flash of a classic ESP32"),
        PinNote(range(34, 40), "GPIO{pin} of a classic ESP32 is an input only"),
    ),
    wiring=(
        PinNote(
            (12,),
            "GPIO{pin} selects the flash voltage of a classic ESP32 at reset: nothing may pull it up then. "
            "If the board does not boot, unplug that signal wire during reset.",
        ),
    ),
)
"""Any ESP32; the notes are on the classic one, which most students have."""
