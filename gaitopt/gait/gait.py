"""A gait: one period, and for each channel a periodic wave of joint targets.

A channel is at ``offset + amplitude`` while ``(t / period + phase) mod 1 < duty`` and at ``offset``
otherwise. Smoothing replaces both edges by half-cosine ramps centred on them. So smoothing does not change
the timing of a gait, and smoothing 0 is exactly the square wave.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tomli_w
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field

from gaitopt.core.files import read_toml, write_text
from gaitopt.core.validation import validated

EDGE_TOLERANCE = 1e-9
"""A time this close before an edge counts as after it, in periods: clocks are sums of rounded steps."""

_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0, allow_inf_nan=False)]


class Channel(BaseModel):
    """The wave of one actuator.

    Attributes:
        duty: share of the cycle spent at `offset + amplitude`, 0 to 1.
        phase: advance of the wave in cycles; 0.25 starts a quarter cycle in.
        amplitude_deg: signed travel from the offset, degrees.
        offset_deg: resting target, degrees.
        smoothing: 0 is the square wave; at 1 the ramps fill the shorter half of the cycle.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    duty: _Share
    phase: _Finite
    amplitude_deg: _Finite
    offset_deg: _Finite = 0.0
    smoothing: _Share = 0.0

    @property
    def ramp_cycles(self) -> float:
        """Length of one ramp, in cycles."""
        return self.smoothing * min(self.duty, 1.0 - self.duty)

    def wave(self, cycles: NDArray[np.float64], edge_tolerance: float) -> NDArray[np.float64]:
        """Return the wave between 0 and 1 at times given in cycles since the gait's start."""
        position = np.mod(cycles + self.phase + edge_tolerance, 1.0)
        position = np.where(position < 1.0, position, 0.0)  # a tiny negative number rounds up to 1
        ramp = self.ramp_cycles
        if ramp == 0.0:
            return (position < self.duty).astype(float)
        half = 0.5 * ramp
        after_rise = np.mod(position + 0.5, 1.0) - 0.5
        after_fall = np.mod(position - self.duty + 0.5, 1.0) - 0.5
        rise = 0.5 + 0.5 * np.sin(np.pi * (np.clip(after_rise, -half, half) / ramp))
        fall = 0.5 - 0.5 * np.sin(np.pi * (np.clip(after_fall, -half, half) / ramp))
        near_rise = np.abs(after_rise) < half
        near_fall = np.abs(after_fall) < half
        flat = (position < self.duty).astype(float)
        return np.where(near_rise, rise, np.where(near_fall, fall, flat))

    def mean_wave(self, begin: NDArray[np.float64], width: float) -> NDArray[np.float64]:
        """Return the exact mean of the wave over intervals of `width` cycles (at most 1) from `begin`."""
        first = np.mod(begin + self.phase, 1.0)
        area = np.zeros_like(first)
        for cycle in (-1, 0, 1, 2):
            for edge, sign in ((cycle, 1.0), (cycle + self.duty, -1.0)):
                area += sign * (self._risen(first + width - edge) - self._risen(first - edge))
        return area / width

    def _risen(self, after: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the integral of one rising edge, from before it to `after` cycles past its middle."""
        ramp = self.ramp_cycles
        if ramp == 0.0:
            return np.maximum(after, 0.0)
        inside = np.clip(after, -0.5 * ramp, 0.5 * ramp)
        over = np.maximum(after - 0.5 * ramp, 0.0)
        return 0.5 * (inside + 0.5 * ramp) - ramp / (2.0 * np.pi) * np.cos(np.pi * inside / ramp) + over

    def targets(self, cycles: NDArray[np.float64], edge_tolerance: float) -> NDArray[np.float64]:
        """Return the joint target in rad at times given in cycles."""
        wave = self.wave(cycles, edge_tolerance)
        offset, amplitude = np.deg2rad((self.offset_deg, self.amplitude_deg)).tolist()
        targets: NDArray[np.float64] = offset + amplitude * wave
        return targets

    @property
    def extremes_deg(self) -> tuple[float, float]:
        """Lowest and highest target, degrees."""
        ends = (self.offset_deg, self.offset_deg + self.amplitude_deg)
        return min(ends), max(ends)


class _GaitFile(BaseModel):
    model_config = ConfigDict(extra="forbid")

    period_s: Annotated[float, Field(strict=True, ge=1e-3, le=1e6, allow_inf_nan=False)]
    channels: Annotated[dict[str, Channel], Field(min_length=1)]


@dataclass(frozen=True)
class Gait:
    """A period in seconds and one `Channel` per actuator, in the model's actuator order."""

    period_s: float
    channels: Mapping[str, Channel]
    name: str = ""

    def targets(self, t: ArrayLike, edge_tolerance: float = EDGE_TOLERANCE) -> NDArray[np.float64]:
        """Return the joint targets at gait times.

        Args:
            t: gait times, s, shape (n,).
            edge_tolerance: periods; a time this close before an edge counts as after it.

        Returns:
            Targets in rad, shape (n, nu), columns in the order of `channels`.
        """
        cycles = np.asarray(t, dtype=float) / self.period_s
        waves = [channel.targets(cycles, edge_tolerance) for channel in self.channels.values()]
        return np.stack(waves, axis=-1)

    @property
    def key(self) -> str:
        """Equal for two gaits with the same commands, also if their names differ."""
        return json.dumps(self.to_dict())

    @property
    def block_s(self) -> float:
        """Length of the blocks in which a trial is judged, s: one cycle."""
        return self.period_s

    @property
    def duration_s(self) -> None:
        """None: a gait has no end."""
        return None

    @property
    def start(self) -> None:
        """None: a gait begins at the problem's start."""
        return None

    def peak_command_speed(self) -> NDArray[np.float64]:
        """Return the largest commanded speed of each channel, rad/s, shape (nu,); inf for square waves.

        A half-cosine ramp of amplitude A that takes w seconds peaks at A pi / (2 w).
        """
        speeds = []
        for channel in self.channels.values():
            travel = abs(math.radians(channel.amplitude_deg))
            ramp_s = channel.ramp_cycles * self.period_s
            moves = travel > 0.0 and 0.0 < channel.duty < 1.0
            speeds.append((travel * math.pi / (2.0 * ramp_s) if ramp_s > 0.0 else math.inf) if moves else 0.0)
        return np.array(speeds)

    def with_period(self, period_s: float) -> Gait:
        """Return the same wave at another period."""
        return replace(self, period_s=period_s)

    def to_dict(self) -> dict[str, object]:
        """Return the content of a gait file."""
        return {
            "period_s": self.period_s,
            "channels": {name: channel.model_dump() for name, channel in self.channels.items()},
        }

    def to_toml(self) -> str:
        """Return the text of a gait file. Reading it gives the same gait to the last bit."""
        return tomli_w.dumps(self.to_dict())

    @staticmethod
    def from_dict(values: object, source: object, name: str = "") -> Gait:
        """Return a checked gait.

        Raises:
            GaitoptError: a key is missing, unknown, or out of range.
        """
        checked = validated(_GaitFile, values, source)
        return Gait(checked.period_s, checked.channels, name)


BEST_FILE = "best.toml"
"""The best gait of a run, in its folder."""


def read_gait(path: Path) -> Gait:
    """Return the gait in a gait file, named after it; the best gait of a run is named after its folder.

    Raises:
        GaitoptError: the file cannot be read or its content is wrong.
    """
    folder = path.resolve().parent.name
    return Gait.from_dict(read_toml(path), path, folder if folder and path.name == BEST_FILE else path.stem)


def write_gait(path: Path | str, gait: Gait) -> None:
    """Write a gait file completely or not at all."""
    write_text(Path(path), gait.to_toml())
