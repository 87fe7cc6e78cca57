"""Servos and what they are sent: their numbers, and their positions on a bus in place of pulses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.export.board import Board
from gaitopt.export.output import Output
from gaitopt.gait.calibration import BusServo, Calibration
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import ChannelBounds


def wired(problem: Problem, output: Output) -> Problem:
    """Return the problem with each servo's number as its pin, and with its positions as pulses.

    Raises:
        GaitoptError: some servos have a number and others do not, or positions leave the servo's travel.
    """
    channels = problem.file.channels
    numbers = {name: output.of(channel.servo) for name, channel in channels.items()}
    if output.first is not None and not any(number is not None for number in numbers.values()):
        numbers = {name: number for number, name in enumerate(channels, start=output.first)}
    changed: dict[str, ChannelBounds] = {}
    for name, channel in channels.items():
        if output.first is not None and numbers[name] is None:
            raise GaitoptError(
                f"{problem.source}: channels.{name}.servo.{output.key}: missing; allowed: one for each "
                "servo, or for none, which numbers them in the order of the channels"
            )
        servo = _calibration(problem, output, name, numbers[name])
        changed[name] = channel.model_copy(update={"servo": servo})
    return replace(problem, file=problem.file.model_copy(update={"channels": changed}))


def _calibration(problem: Problem, output: Output, name: str, number: int | None) -> Calibration:
    servo = problem.file.channels[name].servo
    if output.steps is None:
        return servo.model_copy(update={"pin": number})
    bus, steps = servo.bus or BusServo(), output.steps
    lowest = 1 if bus.min_steps is None else bus.min_steps
    highest = steps.largest if bus.max_steps is None else bus.max_steps
    if not lowest < highest <= steps.largest:
        key, allowed = f"channels.{name}.servo.bus.max_steps", f"{lowest + 1} to {steps.largest}"
        raise bad_value(problem.source, key, highest, allowed)
    return Calibration(
        pin=number,
        neutral_us=steps.neutral if bus.neutral_steps is None else bus.neutral_steps,
        us_per_deg=bus.steps_per_deg or steps.per_deg,
        min_us=lowest,
        max_us=highest,
        direction=servo.direction,
        speed_limit_deg_s=servo.speed_limit_deg_s,
    )


def unset(servo: Calibration, output: Output) -> list[str]:
    """Return the values of a servo's calibration that are not set."""
    if output.steps is None:
        return servo.from_datasheet
    bus = servo.bus or BusServo()
    keys = ("neutral_steps", "steps_per_deg", "min_steps", "max_steps")
    return [f"bus.{key}" for key in keys if getattr(bus, key) is None] + [
        key for key in ("direction", "speed_limit_deg_s") if key in servo.from_datasheet
    ]


def check_numbers(problem: Problem, output: Output, board: Board, used: Mapping[int, str]) -> None:
    """Check that the servos of a wired problem have distinct numbers, and pins that the board has.

    The calibration has checked that there are such outputs of a PCA9685 and such IDs of a bus.

    Args:
        problem: the problem; see `wired`.
        output: what its servos are sent.
        board: the board.
        used: numbers that something else has, and its name.

    Raises:
        GaitoptError: a number is used twice, or a pin is not on the board.
    """
    holders = dict(used)
    for name, channel in problem.file.channels.items():
        key, number = f"channels.{name}.servo", channel.servo.pin
        if number is None:
            continue
        if output.on_pins and number not in board.pins:
            raise bad_value(problem.source, f"{key}.{output.key}", number, board.on_board)
        if number in holders:
            what = f"not the {output.key.rpartition('.')[2]} of {holders[number]}"
            raise bad_value(problem.source, f"{key}.{output.key}", number, what)
        holders[number] = key
