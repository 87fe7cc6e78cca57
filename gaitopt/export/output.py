"""What the servos are sent: pulses of a timer or of a PCA9685, or positions on a bus."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.export.gait_player import DUTY_BITS, duty
from gaitopt.export.pca9685 import divider, ticks, width_us
from gaitopt.gait.calibration import BusServo, Calibration
from gaitopt.gait.table import Unit
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import ChannelBounds

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Steps:
    """The positions of a kind of servo on a bus, where the problem file does not say otherwise.

    Attributes:
        per_deg: steps per degree.
        neutral: the middle of its travel.
        largest: largest position.
    """

    per_deg: float
    neutral: int
    largest: int


@dataclass(frozen=True)
class Output:
    """What the servos are sent.

    Attributes:
        number: what the number of a servo is called: ``GPIO``, ``output`` or ``ID``.
        key: the key in a servo's table of the problem file that gives it.
        of: returns it; None where it is not set.
        rounded: what a servo gets of a pulse, µs or steps, in frames of a length, µs.
        wiring: template of the README's notes on wiring.
        first: number of the first servo where the file numbers none; None where it has to.
        longest_frame_us: longest frame that it can make.
        steps: positions of its servos; None for pulses.
    """

    number: str
    key: str
    of: Callable[[Calibration], int | None]
    rounded: Callable[[int, int], float]
    wiring: Path
    first: int | None = None
    longest_frame_us: int = 2**32 - 1
    steps: Steps | None = None

    @property
    def unit(self) -> Unit:
        """The unit of what is sent."""
        return "us" if self.steps is None else "steps"

    def wired(self, problem: Problem) -> Problem:
        """Return the problem with each servo's number as its pin, and with its positions as pulses.

        Raises:
            GaitoptError: some servos have a number and others do not, or positions leave the servo's travel.
        """
        channels = problem.file.channels
        numbers = {name: self.of(channel.servo) for name, channel in channels.items()}
        if self.first is not None and not any(number is not None for number in numbers.values()):
            numbers = {name: number for number, name in enumerate(channels, start=self.first)}
        changed: dict[str, ChannelBounds] = {}
        for name, channel in channels.items():
            if self.first is not None and numbers[name] is None:
                raise GaitoptError(
                    f"{problem.source}: channels.{name}.servo.{self.key}: missing; allowed: one for each "
                    "servo, or for none, which numbers them in the order of the channels"
                )
            servo = self._calibration(problem, name, numbers[name])
            changed[name] = channel.model_copy(update={"servo": servo})
        return replace(problem, file=problem.file.model_copy(update={"channels": changed}))

    def _calibration(self, problem: Problem, name: str, number: int | None) -> Calibration:
        servo = problem.file.channels[name].servo
        if self.steps is None:
            return servo.model_copy(update={"pin": number})
        bus, steps = servo.bus or BusServo(), self.steps
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

    def unset(self, servo: Calibration) -> list[str]:
        """Return the values of a servo's calibration that are not set."""
        if self.steps is None:
            return servo.from_datasheet
        bus = servo.bus or BusServo()
        keys = ("neutral_steps", "steps_per_deg", "min_steps", "max_steps")
        return [f"bus.{key}" for key in keys if getattr(bus, key) is None] + [
            key for key in ("direction", "speed_limit_deg_s") if key in servo.from_datasheet
        ]


def check_numbers(
    problem: Problem, output: Output, allowed: Iterable[int], words: str, used: dict[int, str]
) -> None:
    """Check that the servos of a wired problem have distinct numbers that are allowed.

    Args:
        problem: the problem; see `Output.wired`.
        output: what its servos are sent.
        allowed: the numbers that there are.
        words: the same, in words.
        used: numbers that something else has, and its name; the servos are added.

    Raises:
        GaitoptError: a number is used twice or not allowed.
    """
    numbers = set(allowed)
    for name, channel in problem.file.channels.items():
        key, number = f"channels.{name}.servo", channel.servo.pin
        if number is None:
            continue
        if number not in numbers:
            raise bad_value(problem.source, f"{key}.{output.key}", number, words)
        if number in used:
            what = f"not the {output.key.rpartition('.')[2]} of {used[number]}"
            raise bad_value(problem.source, f"{key}.{output.key}", number, what)
        used[number] = key


LEDC = Output(
    number="GPIO",
    key="pin",
    of=lambda servo: servo.pin,
    rounded=lambda pulse, frame_us: duty(pulse, frame_us) * (frame_us / (1 << DUTY_BITS)),
    wiring=TEMPLATES / "wiring_pulses.md.jinja",
)
"""Pulses of the timer of an ESP32, 1.22 µs a step at 50 Hz."""

PCA9685 = Output(
    number="output",
    key="output",
    of=lambda servo: servo.output,
    rounded=lambda pulse, frame_us: width_us(ticks(pulse, divider(frame_us)), divider(frame_us)),
    wiring=TEMPLATES / "wiring_pca9685.md.jinja",
    first=0,
    longest_frame_us=41_943,  # PRE_SCALE is at most 255 (NXP, PCA9685 Rev. 4, 7.3.5): 4096 * 256 / 25 MHz
)
"""Pulses of a PCA9685, 4.88 µs a step at 50 Hz."""


def _bus(steps: Steps) -> Output:
    return Output(
        number="ID",
        key="bus.id",
        of=lambda servo: None if servo.bus is None else servo.bus.id,
        rounded=lambda position, _: float(position),
        wiring=TEMPLATES / "wiring_bus.md.jinja",
        first=1,
        steps=steps,
    )


FEETECH_STS = _bus(Steps(4096 / 360, 2048, 4095))
"""Feetech STS3215 and its like: 4096 steps a turn, of which 2048 is the middle (its datasheet, 0.088°)."""

FEETECH_SCS = _bus(Steps(1023 / 300, 511, 1023))
"""Feetech SCS0009 and its like: positions 0 to 1023 over 300° (SCS0009 datasheet). Others turn less far."""

DYNAMIXEL = _bus(Steps(4096 / 360, 2048, 4095))
"""Dynamixel X series: 4096 steps a turn, 2048 is the middle (e-Manual, XL430-W250, Goal Position(116))."""
