"""What looks wrong with a recording only beside the simulation; it is said, and nothing is masked for it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.record.cycles import Cycles, steady
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.noise import block_range
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.robot.signals import name_of
from gaitopt.robot.trajectory import Trajectory

RATIOS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
"""Periods tried, over the commanded one."""

_EXPLAINED = 0.5
_AS_GOOD = 0.85

_PART_OF_LONGER = 0.4
"""Share of what a longer period explains that the commanded one may explain where the longer is the true one:
an uneven walk repeats by twos and fours better than one by one, but one by one too."""

_UNLIKE = 20.0
_REVERSED = -0.6

_LENGTHS = {"they may be millimetres": 1e3, "they may be centimetres": 1e2}


def mismatches(aligned: Aligned, transient: float) -> Iterator[Defect]:
    """Yield a wrong frame rate, a wrong unit of length, and reversed axes.

    Args:
        aligned: the cleaned trial beside its nominal prediction.
        transient: gait time at which the motion may be steady, s.
    """
    trial, simulated = aligned.trial, aligned.simulated
    for check in (_frame_rate, _unit):
        found = [check(trial, simulated, name) for name in trial.markers]
        defects = [defect for defect in found if defect is not None]
        if 2 * len(defects) > len(found):
            yield defects[0]
            return
    for name in trial.markers:
        if _is_reversed(aligned, name, transient):
            axis = name_of(name)
            message = (
                f"{name} moves against the simulated one: does {axis} grow the other way, as in an image?"
            )
            yield Defect("axis_reversed", trial.name, message)


def _frame_rate(trial: Trial, simulated: Trajectory, name: str) -> Defect | None:
    """Does the motion repeat 2, 4 or 8 times too often or too rarely?"""
    period = trial.drive.period_s
    if period is None:
        return None
    keep = trial.used[name]
    shares = _explained_by(trial.time[keep], trial.signals[name][keep], period)
    steady_part = _later(simulated, period)
    own = _explained_by(simulated.time[steady_part], simulated[name][steady_part], period)
    measured, expected = _shortest(shares), _shortest(own)
    if measured is None or expected is None or measured == expected:
        return None
    if measured > expected and shares.get(expected, 0.0) > _PART_OF_LONGER * shares[measured]:
        return None
    ratio = expected / measured
    message = (
        f"{name} repeats {ratio:g} times as often as commanded: the true frame rate may be {1.0 / ratio:g} "
        f"times the one that the time stamps were made with"
    )
    return Defect("wrong_frame_rate", trial.name, message, parameters={"ratio": ratio})


def _explained_by(time: Series, series: Series, period: float) -> dict[float, float]:
    """Return the share of a series' variance that each period explains that fits in it, over `period`."""
    span, frame = float(time[-1] - time[0]), float(np.median(np.diff(np.unique(time))))
    flat = series - np.polyval(np.polyfit(time, series, 1), time)
    shares = {}
    for ratio in RATIOS:
        if 4.0 * frame <= ratio * period <= span / 1.5:
            near = ratio * period * np.linspace(0.95, 1.05, 21)
            shares[ratio] = max(_explained(time, flat, p, frame) for p in near.tolist())
    return shares


def _shortest(shares: dict[float, float]) -> float | None:
    """Return the shortest period that explains a series as well as any; None where none does."""
    best = max(shares.values(), default=0.0)
    if best < _EXPLAINED:
        return None
    return min(ratio for ratio, share in shares.items() if share >= _AS_GOOD * best)


def _explained(time: Series, series: Series, period: float, frame: float) -> float:
    """Return the share of a series' variance that its mean cycle of this period explains, bias removed."""
    bins = int(np.clip(period / frame / 2.0, 4, 24))
    phase = (np.mod(time / period, 1.0) * bins).astype(int) % bins
    counts = np.bincount(phase, minlength=bins)
    means = np.bincount(phase, series, minlength=bins) / np.maximum(counts, 1)
    left = float(((series - means[phase]) ** 2).sum()) / max(1, len(series) - bins)
    whole = float(((series - series.mean()) ** 2).sum()) / max(1, len(series) - 1)
    return 1.0 - left / whole if whole > 0.0 else 0.0


def _unit(trial: Trial, simulated: Trajectory, name: str) -> Defect | None:
    """Are the lengths in pixels, or in another unit than the column says?"""
    later = _later(simulated, trial.drive.block_s)
    expected = block_range(
        Trial.of(trial.name, trial.drive, simulated.time[later], {name: simulated[name][later]}), name
    )
    measured = block_range(trial, name)
    if min(expected, measured) <= 0.0 or 1.0 / _UNLIKE < measured / expected < _UNLIKE:
        return None
    ratio = measured / expected
    known = next((words for words, scale in _LENGTHS.items() if 0.5 < ratio / scale < 2.0), None)
    guess = known or "they may be pixels, or the scale is wrong"
    message = (
        f"{name} moves {ratio:.3g} times as far in a {_block(trial)} as the simulated robot, in metres: "
        f"{guess}"
    )
    return Defect("wrong_unit", trial.name, message, parameters={"ratio": ratio})


def _later(simulated: Trajectory, block_s: float) -> slice:
    """Return the part of a simulation after its first block, a few hundredths of a second apart."""
    begin = int(np.searchsorted(simulated.time, min(block_s, 0.3 * float(simulated.time[-1]))))
    every = max(1, int(block_s / 200.0 / float(simulated.time[1] - simulated.time[0])))
    return slice(begin, None, every)


def _block(trial: Trial) -> str:
    return "block" if trial.drive.period_s is None else "cycle"


def _runs_against(aligned: Aligned, name: str) -> bool:
    """Without cycles: does the whole recording of a coordinate move against the simulated one?"""
    keep = aligned.trial.used[name]
    measured, predicted = aligned.trial.signals[name][keep], aligned.predicted[name][keep]
    if measured.std() == 0.0 or predicted.std() == 0.0:
        return False
    return float(np.corrcoef(measured, predicted)[0, 1]) < _REVERSED


def _is_reversed(aligned: Aligned, name: str, transient: float) -> bool:
    """Does a coordinate move against the simulated one, in its travel or in its cycle?"""
    keep = aligned.trial.used[name]
    time, period = aligned.time[keep], aligned.trial.drive.period_s
    if period is None:
        return _runs_against(aligned, name)
    cycles = Cycles.of(time, period, transient, aligned.trial.name)
    rows = cycles.sampled(time, aligned.trial.signals[name][keep], aligned.trial.frame_s)
    travel, shape, rest = steady(rows)
    travel_simulated, shape_simulated, _ = steady(
        np.interp(cycles.times, aligned.simulated.time, aligned.simulated[name])
    )
    swing = float(np.ptp(shape_simulated))
    if abs(travel_simulated) > 0.5 * swing:
        return travel * travel_simulated < -0.25 * travel_simulated**2
    noisy = float(np.nanstd(rest)) > float(shape.std())
    if noisy or shape.std() == 0.0 or shape_simulated.std() == 0.0:
        return False
    return float(np.corrcoef(shape, shape_simulated)[0, 1]) < _REVERSED
