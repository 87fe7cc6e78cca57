"""Is a recording one of the gait that it names? A wrong film is refused, and costs nothing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from gaitopt.diagnose.gap.align import Aligned, align, unlike
from gaitopt.diagnose.gap.misfits import MISFITS, misfits
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import WHOLE_CYCLES
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.solvers.surrogate import distance
from gaitopt.simulation.rollout import Simulator

ANOTHER_GAIT = MISFITS[0]

_EXPLAINS = 0.7
"""A gait explains a recording if it leaves at most this share of the motion within a cycle."""

_ALIKE = 1e-6
"""Two gaits are the same if they are no further apart: a gait file may be written by hand again."""

_NEAR_PERIOD = 0.1
"""The same for the logarithm of the period alone."""

_NEAR = 0.3
"""Recordings of gaits that are nearer are not told apart: the robot is not known so well."""


def same_gait(space: GaitSpace, one: Gait, other: Gait) -> bool:
    """Return whether two gaits command the same."""
    return one.key == other.key or _apart(space, one, other) < _ALIKE


def film_of(space: GaitSpace, gait: Gait, films: Mapping[int, Gait]) -> int | None:
    """Return the number of the film of a gait, among the gaits of films by number; None where it has none."""
    return next((film for film, own in films.items() if same_gait(space, own, gait)), None)


def wrong_recording(
    trial: Trial, others: Iterable[Gait], space: GaitSpace, robot: Simulator, executor: Executor
) -> str | None:
    """Return why a recording cannot be of its gait, or None.

    Args:
        trial: the recording.
        others: gaits that it may be of instead.
        space: the gait space.
        robot: the robot as it is known.
        executor: where it is simulated.

    Raises:
        GaitoptError: the recording is too short, or the simulation of a gait fails.
    """
    own, cleaned = trial.drive, clean(trial).trial
    assert isinstance(own, Gait)
    span = float(trial.time[-1] - trial.time[0])
    long_enough = [gait for gait in others if span >= WHOLE_CYCLES * gait.period_s]
    far = [
        gait
        for gait in long_enough
        if _apart(space, own, gait) > _NEAR or abs(math.log(gait.period_s / own.period_s)) > _NEAR_PERIOD
    ]
    named: Sequence[Trial] = [
        cleaned,
        *(replace(cleaned, name=f"as {gait.name}", drive=gait) for gait in far),
    ]
    aligned = [align(one, path) for one, path in zip(named, predict(robot, named, executor), strict=True)]
    found = misfits(aligned).get(trial.name, ())
    if not found or (found[0].name == ANOTHER_GAIT and not _explained(aligned[1:])):
        return None
    return found[0].message


def _explained(others: Sequence[Aligned]) -> bool:
    """Return whether another gait explains the recording: a robot may be unlike all predictions."""
    return any(unlike(one.trial, one.simulated, one.offset_s) < _EXPLAINS for one in others)


def _apart(space: GaitSpace, one: Gait, other: Gait) -> float:
    return distance(space.encode(one), space.encode(other), space.circular)
