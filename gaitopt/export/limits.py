"""The angles that the servos can reach: where a gait leaves their range, and the nearest one inside it."""

from __future__ import annotations

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.problem import Problem

_STEPS = 4096
"""Points of a cycle at which a gait is compared with the servos."""

_SLACK_DEG = 1e-6
"""A target this far outside the range, degrees, is a rounding error."""


def allowed_deg(problem: Problem, name: str) -> tuple[float, float]:
    """Return the joint angles that both the problem and the servo's pulses allow, degrees."""
    bounds = problem.file.channels[name]
    ranges = (bounds.range_deg, bounds.servo.range_deg)
    return max(low for low, _ in ranges), min(high for _, high in ranges)


def refuse_outside(problem: Problem, gait: Gait) -> None:
    """Check that every target lies within its servo's range.

    Raises:
        GaitoptError: one does not; the message says which, when in the cycle, and what to do.
    """
    time = np.arange(_STEPS) / _STEPS * gait.period_s
    targets = np.rad2deg(gait.targets(time))
    for index, name in enumerate(gait.channels):
        low, high = allowed_deg(problem, name)
        outside = (targets[:, index] < low - _SLACK_DEG) | (targets[:, index] > high + _SLACK_DEG)
        if outside.any():
            first = int(outside.argmax())
            raise GaitoptError(
                f"channels.{name}: found a target of {targets[first, index]:g} degrees at {time[first]:g} s "
                f"of the cycle; allowed: {low:g} to {high:g}, the servo's range (--clip exports the nearest "
                "gait inside it)"
            )


def clipped(problem: Problem, gait: Gait) -> tuple[Gait, list[str]]:
    """Return the nearest gait inside the servos' ranges, and a sentence for each channel that changed.

    Raises:
        GaitoptError: a servo's pulses reach no part of its channel's range.
    """
    channels, changes = {}, []
    for name, channel in gait.channels.items():
        low, high = allowed_deg(problem, name)
        if low > high:
            raise GaitoptError(f"channels.{name}: the servo's pulses reach no angle of range_deg")
        ends = (channel.offset_deg, channel.offset_deg + channel.amplitude_deg)
        inside = [min(max(end, low), high) for end in ends]
        if max(abs(a - b) for a, b in zip(ends, inside, strict=True)) > _SLACK_DEG:
            changes.append(
                f"{name}: targets from {ends[0]:g} to {ends[1]:g} degrees clipped to "
                f"{inside[0]:g} to {inside[1]:g}"
            )
            channel = _with_ends(channel, *inside)
        channels[name] = channel
    return Gait(gait.period_s, channels, gait.name), changes


def _with_ends(channel: Channel, offset_deg: float, end_deg: float) -> Channel:
    return channel.model_copy(update={"offset_deg": offset_deg, "amplitude_deg": end_deg - offset_deg})
