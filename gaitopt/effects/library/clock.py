"""The clock of a recording."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.robot.trajectory import Trajectory


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
    of_clock=True,
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
    of_clock=True,
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
