"""Commands that arrive late or early."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect
from gaitopt.effects.library.servo import torque_limits
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.gait.drive import Commands
from gaitopt.robot.trajectory import Trajectory


def _in_steps(delay: float, step_s: float) -> tuple[int, float]:
    """Return the whole steps of the clock in a delay, and the rest as a share of a step."""
    whole = math.floor(delay / step_s + 1e-6)
    rest = delay / step_s - whole
    return whole, rest if rest > 1e-6 else 0.0


def _delay_all(sent: Commands, delay: float, parts: Parts) -> Commands:
    """Return the commands, delayed by whole steps of the clock; `_see_late` adds the rest of `delay`."""
    whole, _ = _in_steps(delay, parts.step_s)
    return lambda time: sent(time - whole * parts.step_s)


def _see_late(trajectory: Trajectory, delay: float, parts: Parts, __: np.random.Generator) -> Trajectory:
    """Return the trajectory, delayed by the part of a step that `_delay_all` leaves out.

    A robot that starts at rest and gets all commands later moves in the same way, but later. A command is
    held for a step, so a shift of the whole motion is exact.
    """
    _, rest = _in_steps(delay, parts.step_s)
    return replace(trajectory, time=trajectory.time + rest * parts.step_s) if rest else trajectory


COMMAND_LATENCY = Effect(
    name="command_latency",
    summary="all commands late",
    parameter="delay_s",
    unit="s",
    neutral=0.0,
    low=0.0,
    high=0.2,
    scale="lin",
    prior=Prior(
        "half-normal", 0.0, 0.04, "a 20 ms servo frame, a frame in the servo, and tens of ms in a script"
    ),
    allowed=(0.0, 10.0),
    needs_known_start=True,
    commands=_delay_all,
    observe=_see_late,
)


def saturation(parts: Parts) -> NDArray[np.float64]:
    """Return the error of angle at which each target servo reaches its torque limit, rad; inf without one."""
    gains: NDArray[np.float64] = parts.model.actuator_gainprm[parts.servos, 0]
    return torque_limits(parts) / gains


def partly(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    share: float | NDArray[np.float64],
    largest: float | NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return what acts like a command that changes within a step, rad; NaN where it becomes NaN.

    Args:
        before, after: the command at the beginning and at the end of the step, rad.
        share: share of the step after the change.
        largest: the change that saturates the servo, rad: a larger one would act like the whole change.
    """
    blend = before + share * np.clip(after - before, -largest, largest)
    return np.where(np.isnan(before) | (share >= 1.0), after, blend)


def _delay_one(sent: Commands, delay: float, parts: Parts) -> Commands:
    """Return the commands with those of the target delayed by `delay`, s.

    A command that changes within a step should act for the rest of that step. So in that step the servo
    gets only this share of the change. The change is first limited to the error that saturates the servo:
    a larger one would act like the whole change, and only delays of whole steps would differ. The result
    is exact where the servo has come to rest under the command before; elsewhere a jump is up to a step
    off.
    """
    step_s, servos, largest = parts.step_s, parts.servos, saturation(parts)
    whole, rest = _in_steps(delay, step_s)

    def late(time: NDArray[np.float64]) -> NDArray[np.float64]:
        shifted = sent(time - whole * step_s)[:, servos]
        if rest:
            before = sent(time - (whole + 1) * step_s)[:, servos]
            shifted = partly(before, shifted, 1.0 - rest, largest)
        rows = sent(time).copy()
        rows[:, servos] = shifted
        return rows

    return late


CHANNEL_TIMING = Effect(
    name="channel_timing",
    summary="one servo's command late (positive) or early",
    parameter="delay_s",
    unit="s",
    neutral=0.0,
    low=-0.15,
    high=0.15,
    scale="lin",
    prior=Prior(
        "normal", 0.0, 0.04, "commands written one after another in MicroPython, with sleeps between them"
    ),
    allowed=(-10.0, 10.0),
    target="one",
    commands=_delay_one,
)
