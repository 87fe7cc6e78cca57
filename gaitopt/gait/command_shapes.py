"""Shapes of commands for a bench: steps, ramps, triangles, squares, chirps, random telegraphs, drops.

Every command begins at rest, lies inside each channel's range, has 50 rows a second and lasts 0.5 to 3 s.
The target of a ramp, a triangle or a chirp moves no faster than the servo can. That of a step, a square or a
telegraph jumps, and the servo follows as fast as it can. A drop cuts the power of a servo that was turned
away from rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.gait.logged import LoggedCommands

Array = NDArray[np.float64]

RATE_HZ = 50.0
"""Rows a second: one in each frame of a usual servo."""

ROW_S = 1.0 / RATE_HZ
"""Time between two rows, s."""

SHORTEST_S, LONGEST_S = 0.5, 3.0
"""How long a command may last, s."""

_REST_S = 0.1
"""Every command rests this long before it moves, s."""

_LEAD_S = 0.3
"""A move from rest to a centre elsewhere takes at least this long, s."""

_BODY_S = 2.4
"""What repeats lasts about this long, s."""

_SMALLEST_RAD = math.radians(0.5)
"""A smaller amplitude is no command: servos have a dead band of this order."""

_SLOWEST_HZ = 0.5
"""Frequency at which a chirp begins, Hz."""

Wave = Callable[[float, float, np.random.Generator], Array | None]
"""Called with the shape's time, s, the fastest that its target may move, amplitudes/s, and random numbers.

It returns the target in amplitudes, one row each `ROW_S`, NaN where the servo is unpowered; or None where
the amplitude is too large for the speed.
"""


@dataclass(frozen=True)
class Travel:
    """How far and how fast commands may move some servos.

    Attributes:
        channels: name of each servo, shape (nu,).
        rest: targets at rest, rad, shape (nu,).
        ranges: lowest and highest target, rad, shape (nu, 2).
        speeds: fastest that a target may move where it does not jump, rad/s, shape (nu,).
    """

    channels: tuple[str, ...]
    rest: Array
    ranges: Array
    speeds: Array


@dataclass(frozen=True)
class Shape:
    """One kind of command.

    Attributes:
        name: its name.
        wave: the target over time.
        times_s: its one time, s, as it is tried first: how long a step holds, a ramp rises, a period lasts, …
        both_sides: whether it moves to both sides of a centre; else from rest to one side.
        jumps: whether its target jumps; else it is no faster than the servo.
    """

    name: str
    wave: Wave
    times_s: tuple[float, ...]
    both_sides: bool
    jumps: bool


@dataclass(frozen=True)
class Size:
    """The size of a command.

    Attributes:
        share: amplitude as a share of the room in the range, -1 to 1; negative for the lower side.
        time_s: the shape's time, s.
        moving: index of each channel that moves; the others rest.
        draw: number of the draw, for shapes with random numbers.
    """

    share: float
    time_s: float
    moving: tuple[int, ...]
    draw: int = 0


@dataclass(frozen=True)
class ShapedCommands:
    """Commands of a shape.

    Attributes:
        shape: the shape.
        size: its size.
        commands: the commands.
        amplitude_rad: amplitude of the channel that moves most, rad; negative for the lower side.
    """

    shape: Shape
    size: Size
    commands: LoggedCommands
    amplitude_rad: float

    @property
    def channel(self) -> str:
        """The channel that moves, or ``all``."""
        names = [self.commands.channels[i] for i in self.size.moving]
        return names[0] if len(names) == 1 else "all"


def shaped(shape: Shape, size: Size, travel: Travel, seed: int = 1) -> ShapedCommands | None:
    """Return the commands of a shape; None where the size has no room, or is too fast or too long.

    Args:
        shape: the shape.
        size: its size.
        travel: the servos.
        seed: seed of the random numbers; only a telegraph draws any.
    """
    moves = [_move(shape, size, travel, index) for index in size.moving]
    if not moves or any(abs(amplitude) < _SMALLEST_RAD for _, amplitude in moves):
        return None
    fastest = min(travel.speeds[i] / abs(a) for i, (_, a) in zip(size.moving, moves, strict=True))
    wave = shape.wave(size.time_s, fastest, generator(seed, Stream.COMMAND_SHAPES, size.draw))
    if wave is None:
        return None
    rows = _joined(wave, moves, size.moving, travel)
    if not SHORTEST_S <= len(rows) * ROW_S <= LONGEST_S + 1e-9:
        return None
    largest = max((amplitude for _, amplitude in moves), key=abs)
    time = np.arange(len(rows)) / RATE_HZ
    commands = LoggedCommands.of(travel.channels, time, rows, f"next-{shape.name}", travel.ranges)
    return ShapedCommands(shape, size, commands, float(largest))


def _joined(
    wave: Array, moves: Sequence[tuple[float, float]], moving: Sequence[int], travel: Travel
) -> Array:
    """Return the rows of a command: rest, the move of each channel to its centre, and its wave, rad."""
    leads = [_lead(travel, index, centre) for index, (centre, _) in zip(moving, moves, strict=True)]
    longest = max(map(len, leads))
    rows = np.tile(travel.rest, (longest + len(wave), 1))
    for index, (centre, amplitude), lead in zip(moving, moves, leads, strict=True):
        waiting = np.full(longest - len(lead), centre)
        rows[:, index] = np.concatenate([lead, waiting, centre + amplitude * wave])
    low, high = travel.ranges.T
    return np.where(np.isnan(rows), np.nan, np.clip(rows, low, high))  # beyond it by rounding alone


def _move(shape: Shape, size: Size, travel: Travel, index: int) -> tuple[float, float]:
    """Return the centre about which a channel moves and its signed amplitude, rad."""
    low, high = travel.ranges[index].tolist()
    rest = float(travel.rest[index])
    if shape.both_sides:
        amplitude = size.share * 0.5 * (high - low)
        return min(max(rest, low + abs(amplitude)), high - abs(amplitude)), amplitude
    room = max(0.0, high - rest if size.share > 0.0 else rest - low)
    return rest, size.share * room


def _lead(travel: Travel, index: int, centre: float) -> Array:
    """Return what comes before the wave: rest, and a move to its centre that is no faster than the servo."""
    rest = float(travel.rest[index])
    resting = np.full(_rows(_REST_S), rest)
    if centre == rest:
        return resting
    rows = _rows(max(_LEAD_S, abs(centre - rest) / float(travel.speeds[index])))
    move = rest + (centre - rest) * np.arange(1, rows + 1) / rows
    return np.concatenate([resting, move, np.full(_rows(_REST_S), centre)])


def _rows(seconds: float) -> int:
    """Return the number of rows that last at least as long."""
    return max(1, math.ceil(seconds / ROW_S - 1e-9))


def _step(hold_s: float, _: float, __: np.random.Generator) -> Array:
    """There at once, and back at once."""
    return np.repeat([1.0, 0.0], _rows(hold_s))


def _ramp(rise_s: float, fastest: float, _: np.random.Generator) -> Array:
    """There and back at a constant speed."""
    rows = _rows(max(rise_s, 1.0 / fastest))
    up = np.arange(1, rows + 1) / rows
    return np.concatenate([up, np.ones(_rows(_REST_S)), up[::-1] - 1.0 / rows, np.zeros(_rows(_REST_S))])


def _triangle(period_s: float, fastest: float, _: np.random.Generator) -> Array:
    """To both sides at a constant speed."""
    quarter = _rows(max(period_s / 4.0, 1.0 / fastest))
    up = np.arange(quarter) / quarter
    cycle = np.concatenate([up, 1.0 - up, -up, up - 1.0])
    return np.append(np.tile(cycle, max(1, int(_BODY_S / (len(cycle) * ROW_S)))), 0.0)


def _square(period_s: float, _: float, __: np.random.Generator) -> Array:
    """From side to side at once."""
    half = _rows(period_s / 2.0)
    cycle = np.repeat([1.0, -1.0], half)
    return np.append(np.tile(cycle, max(1, int(_BODY_S / (len(cycle) * ROW_S)))), np.zeros(_rows(_REST_S)))


def _chirp(period_s: float, fastest: float, _: np.random.Generator) -> Array | None:
    """A sine whose period falls to `period_s`, or to the shortest that the servo can follow."""
    highest = min(1.0 / period_s, fastest / (2.0 * math.pi))
    if highest < 1.5 * _SLOWEST_HZ:
        return None
    time = ROW_S * np.arange(1, _rows(_BODY_S) + 1)
    cycles = _SLOWEST_HZ * time + 0.5 * (highest - _SLOWEST_HZ) * time**2 / time[-1]
    wave: Array = np.sin(2.0 * math.pi * cycles[: 1 + _last_turn(cycles)])
    return wave


def _last_turn(cycles: Array) -> int:
    """Return the row nearest to the last zero of a sine: a chirp ends there."""
    return int(np.argmin(np.abs(2.0 * cycles - math.floor(2.0 * cycles[-1]))))


def _telegraph(hold_s: float, _: float, rng: np.random.Generator) -> Array:
    """From side to side at random times, `hold_s` apart on average."""
    holds: list[int] = []
    while sum(holds) < _rows(_BODY_S):
        holds.append(_rows(rng.uniform(0.4, 1.6) * hold_s))
    signs = np.where(np.arange(len(holds)) % 2 == 0, 1.0, -1.0)
    return np.append(np.repeat(signs, holds)[: _rows(_BODY_S)], np.zeros(_rows(_REST_S)))


def _drop(hold_s: float, _: float, __: np.random.Generator) -> Array:
    """There at once, held, then without power."""
    return np.append(np.ones(_rows(hold_s)), np.full(_rows(1.2), np.nan))


SHAPES: Sequence[Shape] = (
    Shape("step", _step, (0.8,), both_sides=False, jumps=True),
    Shape("ramp", _ramp, (1.2, 0.4), both_sides=False, jumps=False),
    Shape("triangle", _triangle, (1.2, 0.6), both_sides=True, jumps=False),
    Shape("square", _square, (0.8, 0.4), both_sides=True, jumps=True),
    Shape("chirp", _chirp, (1.0 / 3.0,), both_sides=True, jumps=False),
    Shape("telegraph", _telegraph, (0.2, 0.1), both_sides=True, jumps=True),
    Shape("drop", _drop, (0.8,), both_sides=False, jumps=True),
)
"""Every shape, in the order in which they are tried."""
