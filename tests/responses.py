"""Made responses of a servo to logged commands, for tests that need no simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from drives import Sampled

from gaitopt.diagnose.gap.align import Aligned, align
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.robot.trajectory import Trajectory

FRAME_S = 0.02
NOISE_RAD = 5e-4
SIGNAL = "joint.arm"
_STEP_S = 1e-3


@dataclass(frozen=True)
class Servo:
    """A servo of second order with a dead time and a limit of its speed.

    Attributes:
        hz: its natural frequency.
        damping: its damping ratio.
        dead_s: time before it sees a command, s.
        limit: largest speed, rad/s.
    """

    hz: float = 8.0
    damping: float = 0.8
    dead_s: float = 0.045
    limit: float = np.inf

    def follow(self, drive: Sampled, seconds: float) -> Trajectory:
        """Return how it follows commands from rest at 0."""
        time = np.arange(0.0, seconds, _STEP_S)
        targets = drive.targets(time)[:, 0]
        wanted = np.where(time < self.dead_s, 0.0, drive.targets(time - self.dead_s)[:, 0])
        stiffness = (2.0 * np.pi * self.hz) ** 2
        loss = 4.0 * np.pi * self.hz * self.damping
        angle, speed, angles = 0.0, 0.0, np.empty(len(time))
        for index, target in enumerate(wanted.tolist()):
            angles[index] = angle
            speed += _STEP_S * (stiffness * (target - angle) - loss * speed)
            speed = min(max(speed, -self.limit), self.limit)
            angle += _STEP_S * speed
        return Trajectory(time, {SIGNAL: angles, "position.turn": angles, "target.turn": targets})


def commands(kind: str, size: float, seconds: float) -> Sampled:
    """Return logged commands: a step, ramp, square, telegraph (random signs), chirp or triangle, rad."""
    time = np.arange(0.0, seconds - 1e-9, FRAME_S)
    turns = 2.5 * time / seconds
    signs = np.sign(np.random.default_rng(3).standard_normal(len(time) // 5 + 1))
    rows = {
        "step": np.ones(len(time)),
        "ramp": time / seconds,
        "square": np.where(turns % 1.0 < 0.5, 1.0, -1.0),
        "telegraph": np.repeat(signs, 5)[: len(time)],
        "chirp": np.sin(2.0 * np.pi * (0.3 * time + 1.35 * time**2 / seconds)),
        "triangle": 2.0 * np.abs(2.0 * (turns % 1.0) - 1.0) - 1.0,
    }[kind]
    return Sampled(time, size * rows[:, None], kind, block_s=0.25)


def recorded(
    path: Trajectory,
    drive: Sampled,
    seconds: float,
    change: Callable[[Series, Callable[[Series], Series]], Series] | None = None,
    noise: float = NOISE_RAD,
    seed: int = 1,
) -> Trial:
    """Return a recording of a response, by a sensor of its own noise.

    Args:
        path: the response.
        drive: what was commanded.
        seconds: length of the recording.
        change: returns what is measured at some times instead of the response, a function of time.
        noise: standard deviation of the noise, rad.
        seed: of the noise.
    """
    time = np.arange(0.0, seconds - 1e-9, FRAME_S)

    def response(at: Series) -> Series:
        return np.interp(at, path.time, path[SIGNAL])

    series = response(time) if change is None else change(time, response)
    series = series + noise * np.random.default_rng(seed).standard_normal(len(time))
    return replace(Trial.of(drive.name, drive, time, {SIGNAL: series}), starts_at_s=0.0)


def beside(
    kind: str,
    size: float,
    seconds: float,
    change: Callable[[Series, Callable[[Series], Series]], Series] | None = None,
    measured: Servo = Servo(),
    simulated: Servo = Servo(),
    noise: float = NOISE_RAD,
) -> Aligned:
    """Return a recording of one servo beside the prediction by another."""
    drive = commands(kind, size, seconds)
    longer = seconds + 0.3
    trial = recorded(measured.follow(drive, longer), drive, seconds, change, noise)
    return align(trial, simulated.follow(drive, longer))
