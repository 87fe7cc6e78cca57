"""The numbers of the servos on their board or bus, and what is sent to them."""

from __future__ import annotations

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.export.format import Format
from gaitopt.export.numbering import check_numbers
from gaitopt.problem.problem import Problem


def check_wiring(problem: Problem, format: Format, led_pin: int | None) -> None:
    """Check that what the servos of a wired problem need can be sent on distinct numbers.

    Args:
        problem: the problem; see `numbering.wired`.
        format: the output format.
        led_pin: GPIO of the sync LED, if any.

    Raises:
        GaitoptError: a number is missing, used twice or not on the board. Or there are too many servos, a
        pulse does not fit into a frame, or the start pose needs a pulse outside the servo's range.
    """
    _check_led(format, led_pin)
    _check_count(problem, format)
    output = format.output
    for name, channel in problem.file.channels.items():
        _check_pulses(problem, format, name)
        if channel.servo.pin is None and format.drives_pins:
            key = f"channels.{name}.servo.{output.key}"
            raise GaitoptError(f"{problem.source}: {key}: missing; this format drives the pins itself")
    used = {led_pin: "--led-pin"} if output.on_pins and led_pin is not None else {}
    check_numbers(problem, output, format.board, used)


def _check_led(format: Format, led_pin: int | None) -> None:
    if led_pin is None:
        return
    if led_pin not in format.board.pins:
        raise GaitoptError(f"--led-pin: found {led_pin}; allowed: {format.board.on_board}")


def _check_count(problem: Problem, format: Format) -> None:
    """Check that the board has as many timers as there are servos."""
    count = len(problem.file.channels)
    timers = format.board.timers if format.drives_pins else format.most_servos
    most = min(format.most_servos, timers)
    if count > most:
        where = f"format {format.name} on the {format.board.name}" if format.drives_pins else format.name
        raise GaitoptError(
            f"found {count} servos; allowed: at most {most} with {where}; a PCA9685 has 16 outputs "
            "(--format pca9685-arduino or pca9685-micropython)"
        )


def _check_pulses(problem: Problem, format: Format, name: str) -> None:
    """Check that the longest pulse of a servo fits into a frame, and that it takes the start pose's pulse."""
    key, servo, output = f"channels.{name}.servo", problem.file.channels[name].servo, format.output
    frame_us = round(1e6 * problem.file.servo.frame_s)
    if frame_us > output.longest_frame_us:
        allowed = f"at most {1e-6 * output.longest_frame_us:g}"
        raise bad_value(problem.source, "servo.frame_s", problem.file.servo.frame_s, allowed)
    if output.unit == "us" and servo.max_us >= frame_us:
        raise bad_value(problem.source, f"{key}.max_us", servo.max_us, f"below the frame's {frame_us} µs")
    start = servo.pulse_us(problem.file.start.ctrl_deg.get(name, 0.0))
    if not servo.min_us - 0.5 <= start <= servo.max_us + 0.5:
        found = f"a pulse of {start:g} µs" if output.unit == "us" else f"a position of {start:g} steps"
        allowed = f"{servo.min_us} to {servo.max_us}; see {key}"
        raise bad_value(problem.source, f"start.ctrl_deg.{name}", found, allowed)


def pin_warnings(problem: Problem, format: Format, led_pin: int | None) -> list[str]:
    """Return the warnings about the pins in use, one sentence each."""
    pins: dict[str, int | None] = {"LED": None if led_pin == format.board.led else led_pin}
    if format.output.on_pins:
        pins = {name: channel.servo.pin for name, channel in problem.file.channels.items()} | pins
    return [f"{name}: {note}" for name, pin in pins.items() for note in format.board.warnings_of(pin)]
