"""Defects that a recording shows only in comparison with the simulation: reported, but not masked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.leftover import channel_of
from gaitopt.diagnose.gap.settings import DEFAULT, MismatchSettings
from gaitopt.diagnose.record.cycles import Cycles, steady
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.noise import block_range, noise_of
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.robot.signals import axis_of, is_position
from gaitopt.robot.trajectory import Trajectory

_LENGTHS = {"they may be millimetres": 1e3, "they may be centimetres": 1e2}
_ANGLES = {"it may be in degrees": math.degrees(1.0), "it may be in rad": math.radians(1.0)}


def mismatches(
    aligned: Aligned, transient: float, settings: MismatchSettings = DEFAULT.mismatches
) -> Iterator[Defect]:
    """Yield a wrong frame rate or a wrong unit, else reversed axes.

    A frame rate or a unit of length is wrong if most coordinates of the marker say so. Angles are checked
    where commands were logged.

    Args:
        aligned: the cleaned trial aligned with its nominal prediction.
        transient: gait time from which the motion may be steady, s.
        settings: see `MismatchSettings`.
    """
    trial = aligned.trial
    if trial.has_log:
        yield from _angles(aligned, settings)
    for check in _OF_MOST_COORDINATES:
        found = [check(trial, aligned.simulated, name, settings) for name in trial.positions]
        defects = [defect for defect in found if defect is not None]
        if 2 * len(defects) > len(found):
            yield defects[0]
            return
    for name in trial.positions:
        if _is_reversed(aligned, name, transient, settings):
            axis = axis_of(name)
            message = (
                f"{name} moves against the simulated one: does {axis} grow the other way, as in an image?"
            )
            yield Defect("axis_reversed", trial.name, message)


def _frame_rate(trial: Trial, simulated: Trajectory, name: str, settings: MismatchSettings) -> Defect | None:
    """Check whether the motion repeats 2, 4 or 8 times too often or too rarely; a period is needed."""
    period = trial.drive.period_s
    if period is None:
        return None
    shares = _explained_by(*trial.counted(name), period, settings)
    later = _later(simulated, period)
    own = _explained_by(simulated.time[later], simulated[name][later], period, settings)
    measured, expected = _shortest(shares, settings), _shortest(own, settings)
    if measured is None or expected is None or measured == expected:
        return None
    if measured > expected and shares.get(expected, 0.0) > settings.part_of_longer * shares[measured]:
        return None
    ratio = expected / measured
    message = (
        f"{name} repeats {ratio:g} times as often as commanded: the true frame rate may be {1.0 / ratio:g} "
        f"times the one that the time stamps were made with"
    )
    return Defect("wrong_frame_rate", trial.name, message, parameters={"ratio": ratio})


def _explained_by(
    time: Series, series: Series, period: float, settings: MismatchSettings
) -> dict[float, float]:
    """Return the share of a series' variance that each period explains, by its ratio to `period`.

    Periods are left out that are too short for the frames or too long for the recording.
    """
    span, frame = float(time[-1] - time[0]), float(np.median(np.diff(np.unique(time))))
    flat = series - np.polyval(np.polyfit(time, series, 1), time)
    around = np.linspace(1.0 - settings.near, 1.0 + settings.near, settings.near_steps)
    shares = {}
    for ratio in settings.ratios:
        if settings.frames_per_period * frame <= ratio * period <= span / settings.periods_per_span:
            near = ratio * period * around
            shares[ratio] = max(_explained(time, flat, p, frame) for p in near.tolist())
    return shares


def _shortest(shares: dict[float, float], settings: MismatchSettings) -> float | None:
    """Return the ratio of the shortest period that explains nearly the most; None if none explains much."""
    best = max(shares.values(), default=0.0)
    if best < settings.explained:
        return None
    return min(ratio for ratio, share in shares.items() if share >= settings.as_good * best)


def _explained(time: Series, series: Series, period: float, frame: float) -> float:
    """Return the share of a series' variance that its mean cycle of a period explains, without bias."""
    bins = int(np.clip(period / frame / 2.0, 4, 24))
    phase = (np.mod(time / period, 1.0) * bins).astype(int) % bins
    counts = np.bincount(phase, minlength=bins)
    means = np.bincount(phase, series, minlength=bins) / np.maximum(counts, 1)
    left = float(((series - means[phase]) ** 2).sum()) / max(1, len(series) - bins)
    whole = float(((series - series.mean()) ** 2).sum()) / max(1, len(series) - 1)
    return 1.0 - left / whole if whole > 0.0 else 0.0


def _unit(trial: Trial, simulated: Trajectory, name: str, settings: MismatchSettings) -> Defect | None:
    """Check whether lengths are in pixels, or in another unit than the column says."""
    later = _later(simulated, trial.drive.block_s)
    path = {name: simulated[name][later]}
    expected = block_range(Trial.of(trial.name, trial.drive, simulated.time[later], path), name)
    measured = block_range(trial, name)
    if min(expected, measured) <= 0.0 or 1.0 / settings.unlike < measured / expected < settings.unlike:
        return None
    ratio = measured / expected
    known = next((words for words, scale in _LENGTHS.items() if 0.5 < ratio / scale < 2.0), None)
    guess = known or "they may be pixels, or the scale is wrong"
    block = "block" if trial.has_log else "cycle"
    message = f"{name} moves {ratio:.3g} times as far in a {block} as the simulated robot, in metres: {guess}"
    return Defect("wrong_unit", trial.name, message, parameters={"ratio": ratio})


def _angles(aligned: Aligned, settings: MismatchSettings) -> Iterator[Defect]:
    """Yield angles that seem to have another unit than their column says, else angles that are reversed."""
    trial = aligned.trial
    for name in trial.signals:
        measured, predicted = trial.signals[name][trial.used[name]], aligned.predicted[name][trial.used[name]]
        turned, least = float(np.ptp(measured)), settings.moves * noise_of(measured)
        expected = _expected_range(aligned, name) or float(np.ptp(predicted))
        if is_position(name) or turned <= least or expected == 0.0:
            continue
        ratio = turned / expected
        guess = next((words for words, scale in _ANGLES.items() if 0.5 < ratio / scale < 2.0), None)
        if guess is not None:
            message = f"{name} turns {ratio:.3g} times as far as commanded or simulated: {guess}"
            yield Defect("wrong_unit", trial.name, message, parameters={"ratio": ratio})
        elif np.ptp(predicted) > least and _runs_against(aligned, name, settings):
            message = f"{name} turns against the simulated joint: does it count the other way?"
            yield Defect("axis_reversed", trial.name, message)


def _expected_range(aligned: Aligned, name: str) -> float:
    """Return how far a joint is commanded to turn, rad; 0 where its commands do not change or say nothing."""
    channel = channel_of(aligned.simulated, name)
    if channel is None:
        return 0.0
    targets = aligned.trial.drive.targets(aligned.time)[:, channel]
    return float(np.ptp(targets)) if np.isfinite(targets).all() else 0.0


_OF_MOST_COORDINATES: tuple[Callable[[Trial, Trajectory, str, MismatchSettings], Defect | None], ...] = (
    _frame_rate,
    _unit,
)


def _later(simulated: Trajectory, block_s: float) -> slice:
    """Return the part of a simulation after its first block, about 200 samples a block."""
    begin = int(np.searchsorted(simulated.time, min(block_s, 0.3 * float(simulated.time[-1]))))
    every = max(1, int(block_s / 200.0 / float(simulated.time[1] - simulated.time[0])))
    return slice(begin, None, every)


def _is_reversed(aligned: Aligned, name: str, transient: float, settings: MismatchSettings) -> bool:
    """Check whether a coordinate moves against the simulated one, in its travel or within its cycle."""
    keep = aligned.trial.used[name]
    time, period = aligned.time[keep], aligned.trial.drive.period_s
    if period is None:
        return _runs_against(aligned, name, settings)
    cycles = Cycles.of(time, period, transient, aligned.trial.name)
    series = aligned.trial.signals[name][keep]
    measured = steady(cycles.sampled(time, series, aligned.trial.frame_s))
    simulated = steady(np.interp(cycles.times, aligned.simulated.time, aligned.simulated[name]))
    if abs(simulated.travel) > settings.travels * float(np.ptp(simulated.shape)):
        return measured.travel * simulated.travel < -settings.travels_back * simulated.travel**2
    noisy = float(np.nanstd(measured.rest)) > float(measured.shape.std())
    if noisy or measured.shape.std() == 0.0 or simulated.shape.std() == 0.0:
        return False
    return float(np.corrcoef(measured.shape, simulated.shape)[0, 1]) < settings.reversed


def _runs_against(aligned: Aligned, name: str, settings: MismatchSettings) -> bool:
    """Check the same without cycles: over the whole recording."""
    keep = aligned.trial.used[name]
    measured, predicted = aligned.trial.signals[name][keep], aligned.predicted[name][keep]
    if measured.std() == 0.0 or predicted.std() == 0.0:
        return False
    return float(np.corrcoef(measured, predicted)[0, 1]) < settings.reversed
