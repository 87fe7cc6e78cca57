"""The angle that a servo follows: the gain, zero offset and speed limit of its command."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.gait.drive import Commands


def _scale_travel(sent: Commands, gain: float, parts: Parts) -> Commands:
    def scaled(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        rows[:, parts.servos] *= gain
        return rows

    return scaled


SERVO_TRAVEL = Effect(
    name="servo_travel",
    summary="gain of the commanded angle, about the servo's zero",
    parameter="gain",
    unit="",
    neutral=1.0,
    low=0.7,
    high=1.3,
    scale="lin",
    prior=Prior(
        "normal",
        1.0,
        0.07,
        "pulse widths at the ends of travel of uncalibrated micro servos differ by 5 to 10 %",
    ),
    target="any",
    commands=_scale_travel,
)


def _round_angles(sent: Commands, step: float, parts: Parts) -> Commands:
    def rounded(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        rows[:, parts.servos] = step * np.round(rows[:, parts.servos] / step)
        return rows

    return rounded


SERVO_RESOLUTION = Effect(
    name="servo_resolution",
    rough=True,
    jumps=True,
    summary="smallest step of the commanded angle: it is rounded to a multiple of this",
    parameter="step_rad",
    unit="rad",
    neutral=0.0,
    low=0.0,
    high=0.05,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.008,
        "12-bit PWM chips at 50 to 100 Hz: 5 to 2.4 us of 2000 us per 180 to 270 degrees; serial servos of "
        "10 to 12 bits: 0.005 to 0.0015 rad; libraries that take whole degrees: 0.017 rad",
    ),
    allowed=(0.0, 1.0),
    target="any",
    commands=_round_angles,
)


def _offset(sent: Commands, offset: float, parts: Parts) -> Commands:
    def shifted(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        rows[:, parts.servos] += offset
        return rows

    return shifted


SERVO_TRIM = Effect(
    name="servo_trim",
    summary="zero offset of the commanded angle",
    parameter="offset_rad",
    unit="rad",
    neutral=0.0,
    low=-0.26,
    high=0.26,
    scale="lin",
    prior=Prior(
        "normal", 0.0, 0.07, "a horn is mounted in steps of 360/21 = 17 degrees, so at worst 8.6 degrees off"
    ),
    target="any",
    commands=_offset,
)


def _limit_speed(sent: Commands, limit: float, parts: Parts) -> Commands:
    """Limit the speed of the angle that the servo follows, from the angle held before.

    The angle stays while the servo is unpowered.
    """
    step_s, servos = parts.step_s, parts.servos
    largest = limit * step_s

    def followed(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        before = sent(time[:1] - step_s)[0]
        for i in servos:
            rows[:, i] = _slewed(before[i], rows[:, i].tolist(), largest)
        return rows

    return followed


def _slewed(before: float, angles: Sequence[float], largest: float) -> list[float]:
    """Return angles that follow others from `before`, rad, by at most `largest` a step; NaN where asked.

    The first angle that is no NaN is met at once where `before` is NaN.
    """

    def follow(at: float, asked: float) -> float:
        return at if asked != asked else asked if at != at else min(max(asked, at - largest), at + largest)

    followed = accumulate(angles, follow, initial=before)
    next(followed)
    return [asked if asked != asked else at for at, asked in zip(followed, angles, strict=True)]


SERVO_SPEED_LIMIT = Effect(
    name="servo_speed_limit",
    summary="the commanded angle is followed no faster than this",
    parameter="limit_rad_s",
    unit="rad/s",
    neutral=math.inf,
    low=1.0,
    high=40.0,
    scale="log",
    prior=Prior(
        "log-normal",
        8.0,
        0.6,
        "datasheets of 9 g servos: 0.08 to 0.12 s per 60 degrees unloaded at 4.8 V, so 9 to 13 rad/s; less "
        "under load",
    ),
    allowed=(0.0, math.inf),
    target="any",
    commands=_limit_speed,
)
