"""What the servos can do of a gait: where it leaves their range, and how far they fall behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.export.format import Format
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.problem import Problem

_STEPS = 4096
"""Points of a cycle at which a gait is compared with the servos."""

_SLACK_DEG = 1e-6
"""A target this far outside the range, degrees, is a rounding error."""

_BEHIND_DEG = 0.5
"""A servo closer than this to its target, degrees, has reached it: the dead band of a 9 g servo."""


@dataclass(frozen=True)
class Lag:
    """How far a servo at its speed limit falls behind its commands, at most, once it is walking."""

    channel: str
    angle_deg: float
    time_s: float


def allowed_deg(problem: Problem, name: str) -> tuple[float, float]:
    """Return the joint angles that both the problem and the servo's pulses allow, degrees."""
    bounds = problem.file.channels[name]
    ranges = (bounds.range_deg, bounds.servo.range_deg)
    return max(low for low, _ in ranges), min(high for _, high in ranges)


def refuse_outside(problem: Problem, gait: Gait) -> None:
    """Check that every target lies within its servo's range.

    Raises:
        GaitoptError: one does not; the message says which, when in the cycle, and how to go on.
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


def check_wiring(problem: Problem, format: Format, led_pin: int | None) -> None:
    """Check that the servo signals can be made on distinct pins of the format's board.

    Raises:
        GaitoptError: a pin is missing, used twice or not on the board, a pulse does not fit into a frame, or
            the start pose asks for a pulse that the servo does not take.
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
    """Return what speaks against the pins in use, one sentence each."""
    pins = {name: channel.servo.pin for name, channel in problem.file.channels.items()} | {"LED": led_pin}
    return [f"{name}: {note}" for name, pin in pins.items() for note in format.board.warnings_of(pin)]


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


def lags(problem: Problem, gait: Gait) -> list[Lag]:
    """Return how far each servo falls behind the gait; servos that keep up are left out."""
    found = []
    cycles = np.arange(2 * _STEPS) / _STEPS
    targets = np.rad2deg(gait.targets(cycles * gait.period_s))
    for index, name in enumerate(gait.channels):
        behind = _behind(targets[:, index], problem.file.channels[name].servo, gait.period_s / _STEPS)
        angle = float(behind.max(initial=0.0))
        if angle > _BEHIND_DEG:
            found.append(Lag(name, angle, _longest(behind > _BEHIND_DEG) * gait.period_s / _STEPS))
    return found


def _behind(targets: NDArray[np.float64], servo: Calibration, step_s: float) -> NDArray[np.float64]:
    """Return the distance of a speed-limited follower from its target in the second cycle, degrees."""
    reach = servo.speed_limit_deg_s * step_s
    position = float(targets[0])
    behind = np.empty_like(targets)
    for step, target in enumerate(targets.tolist()):
        behind[step] = abs(target - position)
        position += min(max(target - position, -reach), reach)
    return behind[len(targets) // 2 :]


def _longest(true: NDArray[np.bool_]) -> int:
    """Return the length of the longest run of a periodic series, at most its own."""
    if true.all():
        return len(true)
    edges = np.flatnonzero(~true)
    return int(np.diff(np.append(edges, edges[0] + len(true))).max()) - 1
