"""Errors of a camera's scale and level."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.robot.rotation import matrices_of_angles, roll_pitch_yaw
from gaitopt.robot.signals import MARKER, kind_of, site_of, site_signals
from gaitopt.robot.trajectory import Trajectory


def moved_marker(
    trajectory: Trajectory, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> Trajectory:
    """Return the trajectory with another marker path; coordinates that were not measured stay out.

    Args:
        trajectory: what is filmed.
        change: from the path to the path that is seen, m, both of shape (n, 3).
    """
    missing = np.zeros(len(trajectory.time))
    path = np.stack([trajectory.signals.get(name, missing) for name in MARKER], axis=-1)
    seen = dict(zip(MARKER, change(path).T, strict=True))
    signals = {name: seen.get(name, series) for name, series in trajectory.signals.items()}
    return replace(trajectory, signals=signals)


def moved_sites(trajectory: Trajectory, turn: NDArray[np.float64], scale: float = 1.0) -> Trajectory:
    """Return the trajectory with other paths and angles of the sites that are observed.

    Args:
        trajectory: what is filmed; sites are in the problem's axes.
        turn: rotation of what is seen, in the problem's axes, shape (3, 3).
        scale: seen over true length.
    """
    signals = dict(trajectory.signals)
    for site in dict.fromkeys(site_of(name) for name in signals if kind_of(name) == "site"):
        names = site_signals(site)
        position, angles = np.split(np.stack([signals[name] for name in names]), 2)
        seen = np.unwrap(roll_pitch_yaw(turn @ matrices_of_angles(*angles)))
        signals |= dict(zip(names, [*(scale * turn @ position), *seen], strict=True))
    return replace(trajectory, signals=signals)


def _scale(trajectory: Trajectory, scale: float, _: Parts, __: np.random.Generator) -> Trajectory:
    return moved_sites(moved_marker(trajectory, lambda path: scale * path), np.eye(3), scale)


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
    role="marker",
    observe=_scale,
)


def _tilt(trajectory: Trajectory, angle: float, parts: Parts, _: np.random.Generator) -> Trajectory:
    """Rotate the path from forward toward up: with a positive angle, a level path seems to climb."""
    axes = parts.axes
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    rotation = axes.T @ turn @ axes
    return moved_sites(moved_marker(trajectory, lambda path: path @ rotation.T), turn)


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
    role="marker",
    observe=_tilt,
)
