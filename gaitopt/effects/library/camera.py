"""What is measured: the camera's scale and tilt, its clock, the tracker's mistakes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect, Parts, Prior
from gaitopt.robot.signals import MARKER
from gaitopt.robot.trajectory import Trajectory

_JUMP = (0.2, 1.0)
"""Shortest and longest jump of an outlier, in spans of the marker's path."""


def _marked(
    trajectory: Trajectory, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> Trajectory:
    """Return the trajectory with another marker path; coordinates that were not measured stay absent.

    Args:
        trajectory: what is filmed.
        change: from the path to the path that is seen, m, both of shape (n, 3).
    """
    missing = np.zeros(len(trajectory.time))
    path = np.stack([trajectory.signals.get(name, missing) for name in MARKER], axis=-1)
    seen = dict(zip(MARKER, change(path).T, strict=True))
    signals = {name: seen.get(name, series) for name, series in trajectory.signals.items()}
    return replace(trajectory, signals=signals)


def _scale(trajectory: Trajectory, scale: float, _: Parts, __: np.random.Generator) -> Trajectory:
    return _marked(trajectory, lambda path: scale * path)


CAMERA_SCALE = Effect(
    name="camera_scale",
    summary="measured over true length",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.85,
    high=1.15,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.03, "a ruler some mm behind the robot's plane, 0.5 m from a phone; lens shading"
    ),
    allowed=(0.0, math.inf),
    observe=_scale,
)


def _tilt(trajectory: Trajectory, angle: float, parts: Parts, _: np.random.Generator) -> Trajectory:
    """Rotate the path from forward toward up: by a positive angle, a level path seems to climb."""
    axes = parts.axes
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    rotation = axes.T @ turn @ axes
    return _marked(trajectory, lambda path: path @ rotation.T)


CAMERA_TILT = Effect(
    name="camera_tilt",
    summary="rotation of the measured plane of forward and up; positive seems to climb",
    parameter="angle_rad",
    unit="rad",
    neutral=0.0,
    low=-0.15,
    high=0.15,
    scale="lin",
    prior=Prior("normal", 0.0, 0.03, "a phone on a stand, level by eye: within 2 degrees"),
    observe=_tilt,
)


def _start_late(trajectory: Trajectory, offset: float, _: Parts, __: np.random.Generator) -> Trajectory:
    return replace(trajectory, time=trajectory.time - offset)


CLOCK_OFFSET = Effect(
    name="clock_offset",
    summary="the recording starts this much later than it says",
    parameter="offset_s",
    unit="s",
    neutral=0.0,
    low=-0.5,
    high=0.5,
    scale="lin",
    prior=Prior("normal", 0.0, 0.1, "a start found by eye in a video: within some frames of 1/30 s"),
    needs_known_start=True,
    shifts_start=True,
    observe=_start_late,
)


def _run_fast(trajectory: Trajectory, rate: float, _: Parts, __: np.random.Generator) -> Trajectory:
    return replace(trajectory, time=rate * trajectory.time)


CLOCK_RATE = Effect(
    name="clock_rate",
    summary="measured over true time",
    parameter="rate",
    unit="",
    neutral=1.0,
    low=0.9,
    high=1.1,
    scale="log",
    prior=Prior(
        "log-normal",
        1.0,
        0.01,
        "quartz is far better; frame rates taken as 30 for 29.97, or variable, are not",
    ),
    allowed=(0.0, math.inf),
    needs_known_start=True,
    observe=_run_fast,
)


def _round_time(trajectory: Trajectory, grid: float, _: Parts, __: np.random.Generator) -> Trajectory:
    return replace(trajectory, time=np.round(trajectory.time / grid) * grid)


CLOCK_ROUNDING = Effect(
    name="clock_rounding",
    summary="time stamps rounded to a grid",
    parameter="grid_s",
    unit="s",
    neutral=0.0,
    low=0.0,
    high=0.2,
    scale="lin",
    prior=Prior("half-normal", 0.0, 0.05, "exports with one or two decimals"),
    allowed=(0.0, math.inf),
    found_in_record=True,
    observe=_round_time,
)


def _jump(trajectory: Trajectory, share: float, parts: Parts, rng: np.random.Generator) -> Trajectory:
    """Move a share of the samples, each on its own, by a random distance across the picture."""
    count = len(trajectory.time)
    hit = rng.random(count) < share
    angle = rng.uniform(0.0, 2.0 * math.pi, count)
    forward, _, up = parts.axes
    direction = np.cos(angle)[:, None] * forward + np.sin(angle)[:, None] * up
    size = rng.uniform(*_JUMP, count)[:, None]

    def jumped(path: NDArray[np.float64]) -> NDArray[np.float64]:
        span = float(np.linalg.norm(np.ptp(path, axis=0))) if count else 0.0
        moved: NDArray[np.float64] = path + hit[:, None] * (span * size * direction)
        return moved

    return _marked(trajectory, jumped)


MARKER_OUTLIERS = Effect(
    name="marker_outliers",
    summary="share of samples that jumped elsewhere",
    parameter="share",
    unit="",
    neutral=0.0,
    low=0.0,
    high=0.3,
    scale="lin",
    prior=Prior("half-normal", 0.0, 0.02, "automatic trackers lose a marker for a few frames in a hundred"),
    allowed=(0.0, 1.0),
    found_in_record=True,
    observe=_jump,
)
