"""A servo's calibration: the pulse width of each joint angle, and how far and how fast the servo turns."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from gaitopt.core.validation import PLAIN_NUMBER

_LONGEST_US = 65535
"""Longest pulse that a table holds, µs."""

_LAST_PIN = 32767
"""Largest GPIO number that a table holds; the export board says which pins exist."""

SAFE_PINS = (13, 16, 17, 18, 19, 21, 22, 23, 25, 26, 27, 32, 33, 4)
"""GPIOs of a module WROOM-32 that do not decide how the ESP32 boots and are quiet meanwhile: its datasheet,
tables "Pin Definitions" and "Strapping Pins"."""

_LAST_ID = 252
"""Largest number of a servo on a bus: 253 to 255 are reserved in the Dynamixel protocol 2 and Feetech's."""

_OUTPUTS = 16
"""Outputs of a PCA9685."""

_ELSEWHERE = ("pin", "output", "bus")
"""What says where a servo is connected, and what it gets in place of pulses."""

_Pulse = Annotated[int, Field(ge=1, le=_LONGEST_US), PLAIN_NUMBER]
_Finite = Annotated[float, Field(allow_inf_nan=False), PLAIN_NUMBER]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False), PLAIN_NUMBER]


class BusServo(BaseModel):
    """A servo on a bus, such as Feetech's STS and SCS or Dynamixel: positions in steps.

    ``position = neutral_steps + direction * steps_per_deg * angle``. The export format knows the defaults.

    Attributes:
        id: its number on the bus.
        neutral_steps: position at joint angle 0.
        steps_per_deg: steps per degree.
        min_steps, max_steps: positions that it may take.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: Annotated[int, Field(ge=0, le=_LAST_ID), PLAIN_NUMBER] | None = None
    neutral_steps: _Finite | None = None
    steps_per_deg: _Positive | None = None
    min_steps: _Pulse | None = None
    max_steps: _Pulse | None = None


class Calibration(BaseModel):
    """A servo on its robot. The defaults are the datasheet's of a 9 g servo (SG92R class, at 4.8 V).

    ``pulse = neutral_us + trim_us + direction * us_per_deg * angle``, angle in degrees of the joint.

    Attributes:
        pin: GPIO of the signal wire.
        output: output of a PCA9685 in place of a pin.
        bus: what a servo on a bus needs in place of pulses.
        neutral_us: pulse at joint angle 0, by design, µs.
        min_us, max_us: pulses that the servo takes, µs.
        us_per_deg: µs per degree; 1000 µs for 90 degrees.
        direction: 1 if longer pulses turn the joint to larger angles, -1 if to smaller ones.
        trim_us: what the built robot needs in addition to `neutral_us`, µs.
        speed_limit_deg_s: unloaded speed; the datasheet's 0.10 s for 60 degrees.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    pin: Annotated[int, Field(ge=0, le=_LAST_PIN), PLAIN_NUMBER] | None = None
    output: Annotated[int, Field(ge=0, lt=_OUTPUTS), PLAIN_NUMBER] | None = None
    bus: BusServo | None = None
    neutral_us: _Finite = 1500.0
    min_us: _Pulse = 500
    max_us: _Pulse = 2500
    us_per_deg: _Positive = 11.1
    direction: Literal[-1, 1] = 1
    trim_us: _Finite = 0.0
    speed_limit_deg_s: _Positive = 600.0

    @model_validator(mode="after")
    def _check(self) -> Calibration:
        if self.min_us >= self.max_us:
            raise ValueError(f"min_us: found {self.min_us}; allowed: below max_us, {self.max_us}")
        return self

    @model_serializer(mode="wrap")
    def _as_written(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Dump only what was set, so that a copy still tells which values are the datasheet's."""
        return {key: value for key, value in dump(self).items() if key in self.model_fields_set}

    @property
    def from_datasheet(self) -> list[str]:
        """The names of the values that were not set."""
        return [key for key in type(self).model_fields if key not in (*self.model_fields_set, *_ELSEWHERE)]

    @property
    def is_calibrated(self) -> bool:
        """Whether a value was set that decides which pulse belongs to which angle."""
        return not self.model_fields_set.isdisjoint({"neutral_us", "us_per_deg", "direction", "trim_us"})

    @property
    def complete(self) -> dict[str, Any]:
        """Every value that a table of pulses needs, set or not."""
        return {key: getattr(self, key) for key in type(self).model_fields if key not in ("output", "bus")}

    def pulse_us(self, angle_deg: float) -> float:
        """Return the pulse width for a joint angle, µs, neither rounded nor clamped."""
        return self.neutral_us + self.trim_us + self.direction * self.us_per_deg * angle_deg

    def angle_deg(self, pulse_us: float) -> float:
        """Return the joint angle of a pulse width, degrees."""
        return self.direction * (pulse_us - self.neutral_us - self.trim_us) / self.us_per_deg

    @property
    def range_deg(self) -> tuple[float, float]:
        """Joint angles between the shortest and the longest pulse, degrees."""
        ends = (self.angle_deg(self.min_us), self.angle_deg(self.max_us))
        return min(ends), max(ends)

    def pulse_per_frame_us(self, speed_deg_s: float, frame_s: float) -> int:
        """Return the largest change of the pulse in one frame within a speed, whole µs, at least 1."""
        change = self.us_per_deg * speed_deg_s * frame_s * (1.0 + 1e-12)
        return max(1, math.floor(min(change, _LONGEST_US)))
