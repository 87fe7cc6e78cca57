"""The rigs of sealed cases: a servo on a bench, and ArcFold held in the hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import other_hand
from numpy.typing import NDArray
from other_servo import ROW_S, Log, Servo, angles, planted, read
from sealed_cases import ALL, Kind, Recording, Robot

Array = NDArray[np.float64]

NOISE_RAD = 0.0007
"""Noise of an encoder before it counts, rad."""

START_RAD = 0.05
"""The servo of the bench comes to a recording's first angle from at most this far away, rad."""

STOP_RAD = 2.25
"""An arm that swings further than this would reach the stops of the real servo, rad."""

BENCH_KINDS: Mapping[str, Kind] = {
    "servo_torque_limit": Kind("limit_n_m", ((2.2, 0.9), (3.1, 4.0)), neutral=2.7),
    "servo_speed_limit": Kind("limit_rad_s", ((5.0, 1.2),), neutral=math.inf),
    "servo_gain": Kind("scale", ((0.8, 0.35), (1.25, 3.0)), neutral=1.0),
    "servo_damping": Kind("scale", ((0.8, 0.1), (1.25, 3.0)), neutral=1.0),
    "servo_inertia": Kind("armature_kg_m2", ((0.007, 0.05),), neutral=0.005),
    "servo_deadband": Kind("half_width_rad", ((0.008, 0.08),)),
    "servo_backlash": Kind("half_width_rad", ((0.008, 0.08),)),
    "servo_travel": Kind("gain", ((0.96, 0.75), (1.04, 1.25)), neutral=1.0),
    "servo_trim": Kind("offset_rad", ((0.02, 0.2), (-0.02, -0.2))),
    "servo_friction": Kind("torque_n_m", ((0.2, 1.0),), neutral=0.1),
    "servo_friction_load": Kind("share", ((0.15, 0.6),)),
    "servo_stiction": Kind("torque_n_m", ((0.1, 0.9),)),
    "servo_lag": Kind("time_constant_s", ((0.085, 0.02), (0.115, 0.15)), neutral=0.1),
    "servo_resolution": Kind("step_rad", ((0.012, 0.05),)),
    "servo_back_emf": Kind("damping_n_m_s_rad", ((0.06, 0.9),)),
    "command_latency": Kind("delay_s", ((0.008, 0.12),)),
    "command_jitter": Kind("sd_s", ((0.004, 0.03),)),
    "ground_slope": Kind("angle_rad", ((0.03, 0.12), (-0.03, -0.12))),
}


@dataclass(frozen=True)
class Bench:
    """The servo on a bench: 16 recordings of 12 commands, of the kinds that real rigs play."""

    problem: str = "servo-bench"
    channels: Sequence[str] = ("servo",)
    joints: Sequence[str] = ("arm",)
    row_s: float = ROW_S
    kinds: Mapping[str, Kind] = field(default_factory=lambda: BENCH_KINDS)

    def recordings(self, rng: np.random.Generator) -> list[Recording]:
        """Return what is commanded in a case."""
        small, middle, large = (rng.uniform(*ends) for ends in ((0.04, 0.06), (0.12, 0.18), (1.2, 1.7)))
        side, other, third = rng.choice([-1.0, 1.0], 3)
        commands = {
            "step-small": (np.full(13, side * small), 2),
            "step-middle": (np.full(13, -side * middle), 1),
            "step-up": (np.full(51, large), 2),
            "step-down": (np.full(51, -rng.uniform(1.2, 1.7)), 1),
            "ramp": (np.linspace(0.0, other * rng.uniform(0.9, 1.6), 101), 1),
            "ramp-slow": (np.linspace(0.0, third * rng.uniform(0.2, 0.4), 101), 1),
            "square": (np.repeat([middle, -middle, middle, -middle], 25), 2),
            "triangle": (_triangle(rng.uniform(0.6, 1.0)), 1),
            "telegraph-small": (rng.uniform(0.1, 0.18) * _telegraph(151, 2, 9, rng), 1),
            "telegraph-large": (rng.uniform(1.0, 1.6) * _telegraph(151, 2, 9, rng), 2),
        }
        found = [
            Recording(f"{name}-{number + 1}", rows[:, None], (0.0,))
            for name, (rows, count) in commands.items()
            for number in range(count)
        ]
        drops = ("drop-high", rng.uniform(-1.0, -0.9)), ("drop-low", rng.uniform(-0.85, -0.75))
        return found + [_drop(name, held) for name, held in drops]

    def chances(self, plan: Sequence[Recording], rng: np.random.Generator) -> list[object]:
        """Return the log of each recording."""
        return [
            Log(
                one.rows[:, 0],
                one.held[0],
                one.held[0] + rng.uniform(-START_RAD, START_RAD),
                _waits(one, rng),
            )
            for one in plan
        ]

    def angles(
        self, robots: Sequence[Robot], plan: Sequence[Recording], chances: Sequence[Sequence[Any]]
    ) -> list[list[Array]]:
        """Return the angles of each robot in each recording."""
        servos = [planted(Servo(), {name: v for (name, _), v in robot.items()}) for robot in robots]
        pairs = [(servo, log) for servo, logs in zip(servos, chances, strict=True) for log in logs]
        flat = angles([servo for servo, _ in pairs], [log for _, log in pairs])
        if max(np.abs(angle).max() for angle in flat) > STOP_RAD:
            raise OverflowError("the arm reaches a stop")
        return [[a[:, None] for a in flat[i : i + len(plan)]] for i in range(0, len(flat), len(plan))]

    def read(self, angle: Array, rng: np.random.Generator) -> Array:
        """Return angles as the encoder gives them."""
        return read(angle, NOISE_RAD, rng)


def _triangle(amplitude: float) -> Array:
    fall = np.linspace(amplitude, -amplitude, 26)[:-1]
    return np.tile(np.concatenate([fall, -fall]), 2)


def _telegraph(rows: int, shortest: int, longest: int, rng: np.random.Generator) -> Array:
    """Return 1 and -1 in turn, each for a number of rows drawn from `shortest` to `longest` - 1."""
    signs = np.where(np.arange(rows) % 2 == 0, 1.0, -1.0)
    return np.repeat(signs, rng.integers(shortest, longest, rows))[:rows]


def _drop(name: str, held: float) -> Recording:
    """Return a recording in which the servo holds an angle for 0.2 s and is then unpowered."""
    rows = np.concatenate([np.full(10, held), np.full(50, np.nan)])
    return Recording(f"{name}-1", rows[:, None], (held,))


def _waits(one: Recording, rng: np.random.Generator) -> Array:
    return rng.uniform(size=len(one.rows))


# --- ArcFold in the hand ----------------------------------------------------------------------

SERVOS = tuple(other_hand.CHANNELS)
_ANY = (ALL, ALL, ALL, *SERVOS)

HAND_KINDS: Mapping[str, Kind] = {
    "servo_torque_limit": Kind("limit_n_m", ((0.2, 0.06), (0.28, 0.36)), _ANY, 0.245),
    "servo_speed_limit": Kind("limit_rad_s", ((4.0, 1.2),), _ANY, math.inf),
    "servo_gain": Kind("scale", ((0.75, 0.25), (1.5, 4.0)), _ANY, 1.0),
    "servo_damping": Kind("scale", ((0.8, 0.3), (1.25, 3.5)), _ANY, 1.0),
    "servo_inertia": Kind("armature_kg_m2", ((2e-4, 9e-4),), _ANY, 1e-4),
    "servo_deadband": Kind("half_width_rad", ((0.01, 0.08),), _ANY),
    "servo_backlash": Kind("half_width_rad", ((0.01, 0.08),), _ANY),
    "servo_travel": Kind("gain", ((0.96, 0.75), (1.04, 1.2)), _ANY, 1.0),
    "servo_trim": Kind("offset_rad", ((0.015, 0.15), (-0.015, -0.15)), _ANY),
    "servo_friction": Kind("torque_n_m", ((0.01, 0.1),), _ANY),
    "servo_friction_load": Kind("share", ((0.05, 0.6),), _ANY),
    "servo_stiction": Kind("torque_n_m", ((0.01, 0.09),), _ANY),
    "servo_lag": Kind("time_constant_s", ((0.01, 0.12),), _ANY),
    "servo_resolution": Kind("step_rad", ((0.012, 0.05),), _ANY),
    "servo_sag": Kind("share_lost", ((0.2, 0.75),)),
    "command_latency": Kind("delay_s", ((0.008, 0.12),)),
    "command_jitter": Kind("sd_s", ((0.004, 0.03),)),
    "channel_timing": Kind("delay_s", ((0.008, 0.1), (-0.008, -0.1)), SERVOS),
}


@dataclass(frozen=True)
class Hand:
    """ArcFold held in the hand: 12 recordings of 9 commands. Each begins with 0.2 s of rest.

    Attributes:
        mjcf: the nominal model, as `gaitopt model` writes it.
    """

    mjcf: str
    problem: str = "arcfold-held"
    channels: Sequence[str] = SERVOS
    joints: Sequence[str] = tuple(other_hand.CHANNELS.values())
    row_s: float = 0.01
    kinds: Mapping[str, Kind] = field(default_factory=lambda: HAND_KINDS)

    def recordings(self, rng: np.random.Generator) -> list[Recording]:
        """Return what is commanded in a case: the middle hinge bends by 0 to 1.4 rad, feet by 0 to -1.4."""
        full = np.array([1.0, -1.0, -1.0])
        large, small = (full * rng.uniform(*ends, 3) for ends in ((0.9, 1.4), (0.08, 0.15)))
        middle = full * rng.uniform(0.4, 0.6, 3)
        gait = np.array([0.25, 0.0, 0.5])
        time = np.arange(100)[:, None] * self.row_s
        commands = {
            **{f"step-{name}": (np.eye(3)[i] * large * np.ones((60, 1)), 1) for i, name in enumerate(SERVOS)},
            "gait": (large * ((time / 1.0 + gait) % 1.0 < 0.5), 2),
            "ramps": (large * np.minimum(1.0, time * rng.uniform(0.8, 1.3, 3)), 1),
            "squares": (middle + small * np.where((time / 0.5 + gait) % 1.0 < 0.5, 1.0, -1.0), 2),
            "slow": (middle * np.sin(math.pi * time * rng.uniform(0.7, 1.0, 3)) ** 2, 1),
            "telegraphs": (large * self._telegraphs(rng), 2),
            "telegraphs-small": (middle + small * (2.0 * self._telegraphs(rng) - 1.0), 1),
        }
        rest = np.zeros((20, 3))
        return [
            Recording(f"{name}-{number + 1}", np.concatenate([rest, rows]), (0.0, 0.0, 0.0))
            for name, (rows, count) in commands.items()
            for number in range(count)
        ]

    def _telegraphs(self, rng: np.random.Generator) -> Array:
        """Return 0 and 1 by chance for each servo, shape (150, 3)."""
        return np.column_stack([0.5 + 0.5 * _telegraph(150, 6, 30, rng) for _ in SERVOS])

    def chances(self, plan: Sequence[Recording], rng: np.random.Generator) -> list[object]:
        """Return the logs of each recording's channels; all of its channels are late together."""
        found: list[object] = []
        for one in plan:
            waits, start = _waits(one, rng), rng.uniform(-START_RAD, START_RAD, 3)
            columns = zip(one.rows.T, one.held, start, strict=True)
            found.append([Log(rows, held, at, waits, self.row_s) for rows, held, at in columns])
        return found

    def angles(
        self, robots: Sequence[Robot], plan: Sequence[Recording], chances: Sequence[Sequence[Any]]
    ) -> list[list[Array]]:
        """Return the angles of each robot in each recording."""
        return [
            [other_hand.angles(self.mjcf, robot, logs) for logs in row]
            for robot, row in zip(robots, chances, strict=True)
        ]

    def read(self, angle: Array, rng: np.random.Generator) -> Array:
        """Return angles as the encoders give them."""
        return read(angle, NOISE_RAD, rng)
