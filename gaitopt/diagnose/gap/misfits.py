"""Trials that cannot be of the gait that they name: another gait's recording, or a robot that stands still.

They would spoil the fit of all others. So they are named, and nothing is fitted to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaitopt.diagnose.gap.align import Aligned, best_offset, unlike
from gaitopt.diagnose.gap.settings import DEFAULT, AlignSettings, MisfitSettings
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.noise import noise_of
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait

_CYCLE = np.linspace(0.0, 1.0, 200, endpoint=False)
"""Phases at which the commands of two gaits are compared."""

MISFITS = ("another_gait", "stands_still")
"""Names of the defects."""


def misfits(
    trials: Sequence[Aligned],
    align: AlignSettings = DEFAULT.align,
    settings: MisfitSettings = DEFAULT.misfits,
) -> dict[str, tuple[Defect, ...]]:
    """Return what is odd about trials that are no recordings of their gaits, by the trial's name.

    Args:
        trials: the trials aligned with their nominal predictions.
        align: how an offset in time is found.
        settings: see `MisfitSettings`.
    """
    found: dict[str, tuple[Defect, ...]] = {}
    for one in trials:
        if one.trial.has_log:
            continue
        defect = _stands_still(one, settings) or _another_gait(one, trials, align, settings)
        if defect is not None:
            found[one.trial.name] = (defect,)
    return found


def _stands_still(aligned: Aligned, settings: MisfitSettings) -> Defect | None:
    """Check whether the robot stands still from some time on while it is commanded to walk.

    A slow robot may seem to stand between its steps. So it must do so for longer at the end than ever before.
    """
    trial, block_s = aligned.trial, aligned.trial.drive.block_s
    edges = np.arange(float(trial.time[0]), float(trial.time[-1]) + 1e-9, settings.window * block_s)
    moves, should = np.zeros(len(edges) - 1, dtype=bool), np.zeros(len(edges) - 1, dtype=bool)
    for name in trial.signals:
        time, series = trial.counted(name)
        measured = _ranges(time, series, edges)
        expected = _ranges(time, aligned.predicted[name][trial.used[name]], edges)
        usual, expects = (float(np.quantile(ranges, settings.usual)) for ranges in (measured, expected))
        least = max(settings.still * usual, settings.above_noise * noise_of(series))
        moves |= measured > least
        should |= expected > settings.expected * expects
    last = int(np.flatnonzero(moves).max(initial=-1)) + 1
    if last == 0:
        return None
    still = [int(part.sum()) for part in np.split(should & ~moves, np.flatnonzero(moves) + 1)]
    if still[-1] < max(settings.still_windows, settings.still_longer * max(still[:-1])):
        return None
    since = float(edges[last])
    message = (
        f"stands still from t = {since:.2f} s on: was its power or its signal lost? Nothing is fitted; to "
        "use the beginning, cut the file there"
    )
    return Defect("stands_still", trial.name, message, parameters={"since_s": since})


def _ranges(time: Series, series: Series, edges: Series) -> Series:
    """Return the range of a series in each window between edges; 0 where no sample lies, shape (windows,)."""
    parts = np.split(series, np.searchsorted(time, edges[1:-1]))
    return np.array([float(np.ptp(part)) if len(part) else 0.0 for part in parts])


def _another_gait(
    aligned: Aligned, trials: Sequence[Aligned], align: AlignSettings, settings: MisfitSettings
) -> Defect | None:
    """Check whether the recording is much more like the prediction of another gait of the data set."""
    trial = aligned.trial
    others = {one.trial.drive.key: one for one in trials if not alike(one.trial.drive, trial.drive, settings)}
    own = unlike(trial, aligned.simulated, aligned.offset_s)
    if own < settings.unlike or not others:
        return None
    errors = {key: _unlike(trial, one, align) for key, one in others.items()}
    best = min(errors, key=lambda key: errors[key])
    if errors[best] > min(settings.explained, settings.more_alike * own):
        return None
    named, seen = trial.drive.name, others[best].trial.drive.name
    message = f"moves as {seen} does, not as {named}: is it another gait's recording? Nothing is fitted"
    return Defect("another_gait", trial.name, message, parameters={"ratio": own / errors[best]})


def _unlike(trial: Trial, other: Aligned, align: AlignSettings) -> float:
    """Return how unlike a recording and the prediction of another trial are: 1 where it explains nothing."""
    of_other = replace(trial, drive=other.trial.drive)  # whose period bounds the offset
    known = trial.starts_at_s
    offset = best_offset(of_other, other.simulated, align) if known is None else known
    return unlike(trial, other.simulated, offset)


def alike(one: Drive, other: Drive, settings: MisfitSettings = DEFAULT.misfits) -> bool:
    """Return whether two gaits command nearly the same, so that their recordings cannot be told apart.

    Args:
        one: a gait; logged commands are like themselves alone.
        other: another one.
        settings: see `MisfitSettings`.
    """
    if one.key == other.key:
        return True
    if not isinstance(one, Gait) or not isinstance(other, Gait):
        return False
    if abs(math.log(one.period_s / other.period_s)) > settings.near_period:
        return False
    curve, another = (gait.targets(_CYCLE * gait.period_s) for gait in (one, other))
    apart, motion = (np.mean((part - part.mean(axis=0)) ** 2) for part in (curve - another, curve))
    return bool(apart <= settings.unlike * motion)
