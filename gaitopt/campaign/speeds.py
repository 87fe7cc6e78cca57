"""The speeds that a film shows, and how far the speed of a gait that is filmed again would be off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.cycles import steady_from
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.gait import Gait
from gaitopt.problem.records import Horizon
from gaitopt.robot.roles import Roles
from gaitopt.robot.signals import MARKER

_AT_REST = 0.5
"""Of the cycles of a short film, at most this share is left out: the robot starts from rest."""

_FEWEST = 3
"""Of fewer cycles than so many, none is left out."""

_HALF = 0.5
"""The last cycle counts where more than this share of it was seen."""

_STILL_M_S = 1e-6
"""A robot that is slower stands still, and drifts as far as one that is so fast."""


@dataclass(frozen=True)
class FilmedSpeed:
    """The speed in one film.

    Attributes:
        mean_m_s: mean speed over whole cycles after the transient, m/s.
        error_m_s: standard error of that mean by the spread of the cycles, m/s; NaN for one cycle.
    """

    mean_m_s: float
    error_m_s: float


def filmed_speed(trial: Trial, roles: Roles, horizon: Horizon) -> FilmedSpeed:
    """Return the forward speed of a recording of a gait.

    Args:
        trial: the recording.
        roles: marker and axes.
        horizon: what a simulation leaves out at the beginning, so that both speeds mean the same.

    Raises:
        GaitoptError: forward motion was not measured, or for less than one cycle.
    """
    time, travelled = _along(_checked(trial), roles, 0)
    speed = _speed(trial, time, travelled, horizon)
    if speed is None:
        raise GaitoptError(f"trial {trial.name}: forward motion: found less than one cycle; allowed: two")
    return speed


def filmed_sideways(trial: Trial, roles: Roles, horizon: Horizon) -> FilmedSpeed | None:
    """Return the sideways speed of a recording of a gait, left positive, as `filmed_speed` does.

    None where it was not measured, or for less than one cycle.
    """
    if _missing(trial, roles, 1):
        return None
    return _speed(trial, *_along(_checked(trial), roles, 1), horizon)


def _checked(trial: Trial) -> Trial:
    if not isinstance(trial.drive, Gait):
        raise GaitoptError(f"trial {trial.name}: found logged commands; allowed: a gait of the campaign")
    return clean(trial).trial


def _speed(trial: Trial, time: Series, travelled: Series, horizon: Horizon) -> FilmedSpeed | None:
    """Return the speed of a recording from its travel, m, at some times, s.

    Each sample is compared with where the robot was one period later, so that what happens within a cycle
    does not count. Of a last cycle that ends with the recording, at least half must be there. None where it
    lasts less than one cycle.
    """
    assert isinstance(trial.drive, Gait)
    period = trial.drive.period_s
    if trial.starts_at_s is not None:  # what the camera saw before the gait began
        walking = time + trial.starts_at_s >= 0.0
        time, travelled = time[walking], travelled[walking]
    starts = time[time <= time[-1] - period * (1.0 - 1e-9)] if len(time) else time
    if not len(starts):
        return None
    moved = np.interp(starts + period, time, travelled) - travelled[: len(starts)]
    samples = np.split(moved, np.flatnonzero(np.diff(((starts - time[0]) / period).astype(int))) + 1)
    if len(samples) > 1 and starts[-1] - starts[-len(samples[-1])] < _HALF * period:
        samples.pop()
    walked_s = 0.0 if trial.starts_at_s is None else float(time[0]) + trial.starts_at_s
    unsteady = math.ceil((steady_from(horizon, trial.drive) - walked_s) / period - 1e-9)
    speeds = [float(one.mean()) / period for one in samples[_left_out(unsteady, len(samples)) :]]
    spread = float(np.std(speeds, ddof=1)) / math.sqrt(len(speeds)) if len(speeds) > 1 else math.nan
    return FilmedSpeed(float(np.mean(speeds)), spread)


def _left_out(unsteady: int, cycles: int) -> int:
    """Return how many cycles at the beginning do not count, of which some are not steady yet."""
    return min(max(unsteady, 0), int(_AT_REST * cycles)) if cycles >= _FEWEST else 0


def _needed(roles: Roles, axis: int) -> dict[str, float]:
    """Return the signals of the marker of which one axis is made, with their shares."""
    shares = zip(MARKER, roles.axes[axis].tolist(), strict=True)
    return {name: share for name, share in shares if abs(share) > 1e-9}


def _missing(trial: Trial, roles: Roles, axis: int) -> list[str]:
    return [name for name in _needed(roles, axis) if name not in trial.signals]


def _along(trial: Trial, roles: Roles, axis: int) -> tuple[Series, Series]:
    """Return time stamps, s, and how far the marker is along an axis of the robot, m, both of shape (n,).

    Args:
        trial: the recording.
        roles: marker and axes.
        axis: 0 for forward, 1 for left.
    """
    needed = _needed(roles, axis)
    if missing := _missing(trial, roles, axis):
        raise GaitoptError(f"trial {trial.name}: no {missing[0]}; a campaign needs the motion forward")
    used = np.logical_and.reduce([trial.used[name] for name in needed])
    time, first = np.unique(trial.time[used], return_index=True)
    total = sum(share * trial.signals[name][used] for name, share in needed.items())
    return time, np.asarray(total, dtype=float)[first]


def confirmed(films: Sequence[tuple[int, str, FilmedSpeed]], odd: Sequence[str], within: float) -> list[bool]:
    """Return which recordings count.

    One that fits no explanation of the others may be a slip, or of another robot; or no effect explains what
    the robot does. It counts where it is not alone: another recording of the same film has the same speed.

    Args:
        films: number of the film, name and speed of each recording.
        odd: names of those that fit no explanation.
        within: share of the faster one that two of the same speed may differ by.
    """

    def alike(one: FilmedSpeed, other: FilmedSpeed) -> bool:
        speeds = one.mean_m_s, other.mean_m_s
        return abs(speeds[0] - speeds[1]) <= within * max(map(abs, speeds))

    return [
        name not in odd
        or any(
            number == another and name != repeat and alike(speed, its_speed)
            for another, repeat, its_speed in films
        )
        for number, name, speed in films
    ]


@dataclass(frozen=True)
class Measured:
    """What films say of the speed of the gaits.

    Attributes:
        means: mean speed over the films of each gait, m/s, by the film's number.
        counts: films of each.
        repeatability_m_s: standard deviation of the speed of one film of a gait that is filmed again, m/s.
    """

    means: Mapping[int, float]
    counts: Mapping[int, int]
    repeatability_m_s: float

    @staticmethod
    def of(films: Sequence[tuple[int, FilmedSpeed]], least: float) -> Measured:
        """Return what films say.

        Repeats show the repeatability; until there are many, the spread of the cycles counts as much as one
        repeat does.

        Args:
            films: number of the gait's film, and the speed, of each recording.
            least: smallest repeatability, as a share of the highest speed.
        """
        speeds: dict[int, list[float]] = {}
        for number, one in films:
            speeds.setdefault(number, []).append(one.mean_m_s)
        errors = [one.error_m_s for _, one in films if math.isfinite(one.error_m_s)]
        cycles = float(np.median(errors)) ** 2 if errors else 0.0
        apart = sum(float(np.sum((np.array(own) - np.mean(own)) ** 2)) for own in speeds.values())
        freedom = sum(len(own) - 1 for own in speeds.values())
        spread = math.sqrt((cycles + apart) / (1.0 + freedom))
        floor = least * max((abs(float(np.mean(own))) for own in speeds.values()), default=0.0)
        means = {number: float(np.mean(own)) for number, own in speeds.items()}
        return Measured(means, {number: len(own) for number, own in speeds.items()}, max(spread, floor))


def filmed_drifts(
    films: Sequence[tuple[int, Trial]], forward: Mapping[int, float], roles: Roles, horizon: Horizon
) -> dict[int, float]:
    """Return sideways over forward travel, left positive, by the film's number, where both were measured.

    Args:
        films: number of the film of each recording.
        forward: forward speed of each film, m/s.
        roles: marker and axes.
        horizon: what is left out at the beginning.
    """
    shown: dict[int, list[float]] = {}
    for number, trial in films:
        sideways = filmed_sideways(trial, roles, horizon)
        if sideways is not None and number in forward:
            shown.setdefault(number, []).append(sideways.mean_m_s)
    return {n: float(np.mean(own)) / max(abs(forward[n]), _STILL_M_S) for n, own in shown.items()}
