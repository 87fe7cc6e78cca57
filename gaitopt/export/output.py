"""What the servos are sent: pulses of a timer or of a PCA9685, or positions on a bus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.export.gait_player import DUTY_BITS, duty
from gaitopt.export.pca9685 import divider, ticks, width_us

if TYPE_CHECKING:  # the help of `gaitopt export` lists the formats, and loads no simulator
    from gaitopt.gait.calibration import Calibration
    from gaitopt.gait.table import Unit

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
        protocol: the bus's, one of `bus_packets.PROTOCOLS`; empty for pulses.
        steps: positions of its servos; None for pulses.
    """

    number: str
    key: str
    of: Callable[[Calibration], int | None]
    rounded: Callable[[int, int], float]
    wiring: Path
    first: int | None = None
    longest_frame_us: int = 2**32 - 1
    protocol: str = ""
    steps: Steps | None = None

    @property
    def unit(self) -> Unit:
        """The unit of what is sent."""
        return "us" if self.steps is None else "steps"

    @property
    def on_pins(self) -> bool:
        """Whether the servos are on pins of the board itself."""
        return self.key == "pin"


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


def _bus(protocol: str, steps: Steps) -> Output:
    return Output(
        number="ID",
        key="bus.id",
        of=lambda servo: None if servo.bus is None else servo.bus.id,
        rounded=lambda position, _: float(position),
        wiring=TEMPLATES / "wiring_bus.md.jinja",
        first=1,
        protocol=protocol,
        steps=steps,
    )


FEETECH_STS = _bus("feetech-sts", Steps(4096 / 360, 2048, 4095))
"""Feetech STS3215 and its like: 4096 steps a turn, of which 2048 is the middle (its datasheet, 0.088°)."""

FEETECH_SCS = _bus("feetech-scs", Steps(1023 / 300, 511, 1023))
"""Feetech SCS0009 and its like: positions 0 to 1023 over 300° (SCS0009 datasheet). Others turn less far."""

DYNAMIXEL = _bus("dynamixel", Steps(4096 / 360, 2048, 4095))
"""Dynamixel X series: 4096 steps a turn, 2048 is the middle (e-Manual, XL430-W250, Goal Position(116))."""
