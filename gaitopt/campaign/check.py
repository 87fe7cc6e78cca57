"""Is a recording one of the gait that it names? A wrong film is refused, and costs nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.misfits import alike, misfits
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import WHOLE_CYCLES
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.solvers.surrogate import distance
from gaitopt.simulation.rollout import Simulator

_ALIKE = 1e-6
"""Two gaits are the same if they are no further apart: a gait file may be written by hand again."""


def same_gait(space: GaitSpace, one: Gait, other: Gait) -> bool:
    """Return whether two gaits command the same."""
    return one.key == other.key or distance(space.encode(one), space.encode(other), space.circular) < _ALIKE


def film_of(space: GaitSpace, gait: Gait, films: Mapping[int, Gait]) -> int | None:
    """Return the number of the film of a gait, among the gaits of films by number; None where it has none."""
    return next((film for film, own in films.items() if same_gait(space, own, gait)), None)


def wrong_recording(trial: Trial, others: Iterable[Gait], robot: Simulator, executor: Executor) -> str | None:
    """Return why a recording cannot be of its gait, or None.

    Args:
        trial: the recording.
        others: gaits that it may be of instead.
        robot: the robot as it is known.
        executor: where it is simulated.

    Raises:
        GaitoptError: the recording is too short, or the simulation of a gait fails.
    """
    own, cleaned = trial.drive, clean(trial).trial
    assert isinstance(own, Gait)
    span = float(trial.time[-1] - trial.time[0])
    long_enough = [gait for gait in others if span >= WHOLE_CYCLES * gait.period_s]
    told_apart = [gait for gait in long_enough if not alike(gait, own)]
    named: Sequence[Trial] = [
        cleaned,
        *(replace(cleaned, name=f"as {gait.name}", drive=gait) for gait in told_apart),
    ]
    aligned = [align(one, path) for one, path in zip(named, predict(robot, named, executor), strict=True)]
    found = misfits(aligned).get(trial.name, ())
    return found[0].message if found else None
