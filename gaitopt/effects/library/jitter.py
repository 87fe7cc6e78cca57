"""Commands that arrive late by chance."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import UNIFORM_WIDTH
from gaitopt.core.streams import COMMAND_JITTER_SEED, Stream, generator
from gaitopt.effects.effect import Effect
from gaitopt.effects.library.timing import partly, saturation
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.gait.drive import Commands

Array = NDArray[np.float64]

_FRAME_S = 0.01
"""Changes within this time are sent together, s: a period of a board's pulses, a row of a log at 100 Hz."""

_FRAME_EDGE = 0.2837
"""Share of a frame before its time: an edge of frames that rows at a round rate do not come close to."""


def _late_by_chance(sent: Commands, sd: float, parts: Parts) -> Commands:
    """Return the commands, each change of them late by its own time.

    A command waits for the next period of the pulses and the next pass of the servo's loop, which do not
    know of it: its delay is uniform, from none to `UNIFORM_WIDTH` times `sd`. Servos that get their commands
    in one frame wait equally long. No command overtakes the one before.
    """
    step_s, servos = parts.step_s, parts.servos
    largest = saturation(parts)
    longest = math.ceil(UNIFORM_WIDTH * sd / step_s) + 1

    def late(time: Array) -> Array:
        rows = sent(time).copy()
        clock = time[0] + step_s * np.arange(-longest, round((time[-1] - time[0]) / step_s) + 1)
        earlier, waited = sent(clock), UNIFORM_WIDTH * sd * _draws(clock)
        for i, most in zip(servos, largest, strict=True):
            rows[:, i] = _arriving(clock, earlier[:, i], waited, time, step_s, most)
        return rows

    return late


def _arriving(clock: Array, sent: Array, waited: Array, time: Array, step_s: float, largest: float) -> Array:
    """Return what one servo gets in the steps that begin at `time`, rad, shape (m,).

    Args:
        clock: times of sending, s, shape (n,).
        sent: what is sent then, rad, shape (n,).
        waited: how long a change sent then is on its way, s, shape (n,).
        time: when the steps begin, s, shape (m,).
        step_s: length of a step, s.
        largest: largest change that a servo answers to, rad.
    """
    changed = np.concatenate([[False], (sent[1:] != sent[:-1]) & ~(np.isnan(sent[1:]) & np.isnan(sent[:-1]))])
    arrival = np.maximum.accumulate(np.where(changed, clock + waited, -math.inf))
    begin = np.searchsorted(arrival, time + 1e-6 * step_s, side="right") - 1
    end = np.searchsorted(arrival, time + (1.0 - 1e-6) * step_s, side="right") - 1
    before, after = sent[begin], sent[end]
    share = np.where(end > begin, (time - arrival[end]) / step_s + 1.0, 1.0)
    return partly(before, after, share, largest)


def _draws(time: Array) -> Array:
    """Return a number from 0 to 1 for each time, the same for times in one frame; shape (n,)."""
    frame = np.maximum(np.floor(time / _FRAME_S + _FRAME_EDGE).astype(int), 0)
    numbers: Array = _numbers(1 << int(frame[-1]).bit_length())[frame]
    return numbers


@functools.lru_cache(maxsize=4)
def _numbers(count: int) -> Array:
    """Return the first `count` random numbers of all commands; fewer are the beginning of more."""
    return generator(COMMAND_JITTER_SEED, Stream.COMMAND_JITTER).random(count)


COMMAND_JITTER = Effect(
    name="command_jitter",
    rough=True,
    summary="each change of command late by chance, by its own time: uniform, with this standard deviation",
    parameter="sd_s",
    unit="s",
    neutral=0.0,
    low=0.0,
    high=0.05,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.008,
        "waiting for pulses of 50 to 100 Hz: 3 to 6 ms; a script on a computer, USB and Bluetooth: 1 to 20 "
        "ms",
    ),
    allowed=(0.0, 1.0),
    target="any",
    commands=_late_by_chance,
)
