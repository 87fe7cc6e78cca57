"""The gait space of a search: a gait as a point of the unit box, with circular phases."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.gait import Channel, Gait

Range = tuple[float, float]


@dataclass(frozen=True)
class ChannelSpace:
    """What a search may do with one actuator.

    Attributes:
        range_deg: travel of the servo; offset and offset + amplitude stay inside.
        amplitude_deg: signed amplitudes allowed; at most the width of `range_deg`.
        duty: duty factors allowed.
        smoothing: smoothing allowed.
        middle_deg: where the middle between both ends of a wave may be, as far as the travel allows.
    """

    range_deg: Range
    amplitude_deg: Range
    duty: Range
    smoothing: Range
    middle_deg: Range = (-math.inf, math.inf)

    def offset_deg(self, amplitude_deg: float) -> Range:
        """Return the offsets that keep a wave of this amplitude inside the servo's travel."""
        low, high = self.range_deg
        low, high = low - min(0.0, amplitude_deg), high - max(0.0, amplitude_deg)
        high = max(low, high)
        first, last = (min(max(middle - 0.5 * amplitude_deg, low), high) for middle in self.middle_deg)
        return first, last


@dataclass(frozen=True)
class Variable:
    """One coordinate of the space: its name, and whether it is an angle on the cycle."""

    name: str
    circular: bool = False


@dataclass(frozen=True)
class GaitSpace:
    """Bounds of a gait and the map between gaits and points of the unit box.

    Coordinates are the logarithm of the period, then for each channel duty, phase, amplitude, offset (as a
    share of the travel that the amplitude leaves free) and smoothing. Phases count from the first channel.
    Its own phase is no coordinate, because a shift of all phases is only a shift of time. A phase is a
    circle of circumference 1 and has no bounds.

    Attributes:
        period_s: periods allowed, s.
        channels: what a search may do with each actuator, in the model's order.
    """

    period_s: Range
    channels: Mapping[str, ChannelSpace]

    @property
    def variables(self) -> list[Variable]:
        """The coordinates in order."""
        variables = [Variable("period_s")]
        for index, name in enumerate(self.channels):
            variables.append(Variable(f"{name}.duty"))
            if index > 0:
                variables.append(Variable(f"{name}.phase", circular=True))
            for key in ("amplitude_deg", "offset_deg", "smoothing"):
                variables.append(Variable(f"{name}.{key}"))
        return variables

    @property
    def circular(self) -> NDArray[np.bool_]:
        """Which coordinates are circular, shape (d,)."""
        return np.array([variable.circular for variable in self.variables])

    def wrap(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `point` moved into the unit box: phases wrapped, all else clipped."""
        wrapped: NDArray[np.float64] = np.where(self.circular, point % 1.0, point.clip(0.0, 1.0))
        wrapped[self.circular & (wrapped == 1.0)] = 0.0  # a tiny negative phase rounds up to 1
        return wrapped

    def decode(self, point: NDArray[np.float64], name: str = "") -> Gait:
        """Return the gait at a point, shape (d,); every point is a gait inside the bounds."""
        values = iter(self.wrap(point).tolist())
        low, high = self.period_s
        period = math.exp(_at((math.log(low), math.log(high)), next(values)))
        channels = {}
        for index, (channel_name, space) in enumerate(self.channels.items()):
            duty = _at(space.duty, next(values))
            phase = next(values) if index > 0 else 0.0
            amplitude = _at(space.amplitude_deg, next(values))
            offset = _at(space.offset_deg(amplitude), next(values))
            smoothing = _at(space.smoothing, next(values))
            channels[channel_name] = Channel(
                duty=duty, phase=phase, amplitude_deg=amplitude, offset_deg=offset, smoothing=smoothing
            )
        return Gait(min(max(period, low), high), channels, name)

    def encode(self, gait: Gait) -> NDArray[np.float64]:
        """Return the point of a gait, shape (d,); values outside the bounds are moved to the bounds."""
        low, high = self.period_s
        point = [_share((math.log(low), math.log(high)), math.log(gait.period_s))]
        reference_phase = gait.channels[next(iter(self.channels))].phase
        for index, (name, space) in enumerate(self.channels.items()):
            channel = gait.channels[name]
            point.append(_share(space.duty, channel.duty))
            if index > 0:
                point.append(math.fmod(math.fmod(channel.phase - reference_phase, 1.0) + 1.0, 1.0))
            point.append(_share(space.amplitude_deg, channel.amplitude_deg))
            point.append(_share(space.offset_deg(channel.amplitude_deg), channel.offset_deg))
            point.append(_share(space.smoothing, channel.smoothing))
        return np.array(point).clip(0.0, 1.0)


def _at(bounds: Range, share: float) -> float:
    low, high = bounds
    return min(max(low + share * (high - low), low), high)


def _share(bounds: Range, value: float) -> float:
    low, high = bounds
    return (value - low) / (high - low) if high > low else 0.0
