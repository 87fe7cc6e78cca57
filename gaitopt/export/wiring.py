"""The pins of the servos, and the pulses sent on them."""

from __future__ import annotations

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.export.format import Format
from gaitopt.problem.problem import Problem


def check_wiring(problem: Problem, format: Format, led_pin: int | None) -> None:
    """Check that the servo signals can be made on distinct pins of the format's board.

    Raises:
        GaitoptError: a pin is missing, used twice or not on the board. Or a pulse does not fit into a frame,
        or the start pose needs a pulse outside the servo's range.
    """
    frame_us = round(1e6 * problem.file.servo.frame_s)
    pins = format.board.pins
    on_board = f"{pins.start} to {pins.stop - 1}, the pins of the {format.board.name}"
    used = {led_pin: "--led-pin"} if led_pin is not None else {}
    if led_pin is not None and led_pin not in pins:
        raise GaitoptError(f"--led-pin: found {led_pin}; allowed: {on_board}")
    for name, channel in problem.file.channels.items():
        key, servo = f"channels.{name}.servo", channel.servo
        _check_pulses(problem, name, frame_us)
        if servo.pin is None:
            if format.drives_pins:
                raise GaitoptError(
                    f"{problem.source}: {key}.pin: missing; this format drives the pins itself"
                )
            continue
        if servo.pin not in pins:
            raise bad_value(problem.source, f"{key}.pin", servo.pin, on_board)
        if servo.pin in used:
            raise bad_value(problem.source, f"{key}.pin", servo.pin, f"not the pin of {used[servo.pin]}")
        used[servo.pin] = key


def _check_pulses(problem: Problem, name: str, frame_us: int) -> None:
    """Check that the longest pulse of a servo fits into a frame, and that it takes the start pose's pulse."""
    key, servo = f"channels.{name}.servo", problem.file.channels[name].servo
    if servo.max_us >= frame_us:
        raise bad_value(problem.source, f"{key}.max_us", servo.max_us, f"below the frame's {frame_us} µs")
    start = servo.pulse_us(problem.file.start.ctrl_deg.get(name, 0.0))
    if not servo.min_us - 0.5 <= start <= servo.max_us + 0.5:
        allowed = f"{servo.min_us} to {servo.max_us}; see {key}"
        raise bad_value(problem.source, f"start.ctrl_deg.{name}", f"a pulse of {start:g} µs", allowed)


def pin_warnings(problem: Problem, format: Format, led_pin: int | None) -> list[str]:
    """Return the warnings about the pins in use, one sentence each."""
    pins = {name: channel.servo.pin for name, channel in problem.file.channels.items()} | {"LED": led_pin}
    return [f"{name}: {note}" for name, pin in pins.items() for note in format.board.warnings_of(pin)]
