"""What is wrong with a recording itself, found before anything is fitted and said in plain words.

Nothing is dropped silently: every defect lists the samples it masked or the time stamps it corrected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from gaitopt.diagnose.record.trial import Flags, Series, Trial
from gaitopt.robot.signals import is_marker

_DROPPED = 1.8
"""Steps longer than this many typical ones have frames missing."""

_FROZEN_SAMPLES = 4
_OUTLIER_WINDOW = 7
"""Samples whose median an outlier strays from; fewer where they would span an eighth of a cycle."""

_OUTLIER_SIGMAS = 6.0
_OUTLIER_RANGE = 0.05
"""An outlier strays from the median of its neighbours by this share of what a cycle goes through."""


@dataclass(frozen=True)
class Defect:
    """One thing wrong with a recording.

    Attributes:
        name: ``gaps``, ``frozen_frames``, ``marker_outliers``, ``clock_rounding``,
            ``wrong_frame_rate``, ``wrong_unit`` or ``axis_reversed``.
        trial: name of the trial.
        message: what was found, and what was done about it.
        masked: number of time stamps with samples that do not count.
        spans_s: first and last time stamp of each stretch concerned, s, on the recording's clock.
        errors_m: RMS error over the whole trial that the defect put into each marker coordinate, m, as
            far as the record itself tells.
        parameters: what the defect amounts to: ``share``, ``grid_s``, ``ratio``.
    """

    name: str
    trial: str
    message: str
    masked: int = 0
    spans_s: tuple[tuple[float, float], ...] = ()
    errors_m: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def error_m(self) -> float:
        """RMS error that the defect put into the marker's record, m."""
        return math.hypot(*self.errors_m.values())

    def to_dict(self) -> dict[str, object]:
        """Return the defect for a JSON file."""
        return asdict(self) | {"error_m": self.error_m}


Found = tuple[Trial, Defect | None]
"""A trial once a defect is masked or corrected, and the defect; the same trial and None without one."""


def gaps(trial: Trial) -> Found:
    """Frames that are missing, and samples that are blank."""
    steps, frame = np.diff(trial.time), trial.frame_s
    long = np.flatnonzero(steps > _DROPPED * frame)
    dropped = int(np.round(steps[long] / frame - 1.0).sum())
    blank = np.logical_or.reduce([~np.isfinite(series) for series in trial.signals.values()])
    parts = []
    if dropped:
        longest = long[steps[long].argmax()]
        parts.append(
            f"{counted(dropped, 'frame')} missing in {counted(len(long), 'gap')}, the longest "
            f"{steps[longest]:.2g} s at t = {trial.time[longest]:.2f} s"
        )
    if blank.any():
        parts.append(f"{counted(int(blank.sum()), 'time stamp')} with a blank sample")
    if not parts:
        return trial, None
    spans = tuple((float(trial.time[i]), float(trial.time[i + 1])) for i in long)
    return trial, Defect(
        "gaps", trial.name, "; ".join(parts), int(blank.sum()), spans + spans_of(trial.time, blank)
    )


def frozen(trial: Trial) -> Found:
    """The tracker held its last value while the robot went on, and then jumped to catch up."""
    same = np.logical_and.reduce([np.diff(series) == 0.0 for series in trial.signals.values()])
    limits = {name: _jump(series) for name, series in markers(trial).items()}
    flags = np.zeros(len(trial.time), dtype=bool)
    for begin, end in runs(same):
        if end - begin < _FROZEN_SAMPLES - 1 or end + 1 >= len(trial.time):
            continue
        jumped = [abs(float(s[end + 1] - s[end])) > limits[name] for name, s in markers(trial).items()]
        flags[begin + 1 : end + 1] |= any(jumped)
    if not flags.any():
        return trial, None
    spans = spans_of(trial.time, flags)
    message = (
        f"{counted(int(flags.sum()), 'frame')} frozen (first at t = {spans[0][0]:.2f} s): the tracker held "
        f"its last value and then jumped; masked"
    )
    cleaned = trial.masked(flags)
    errors = errors_of(trial, bridged(cleaned), flags)
    return cleaned, Defect("frozen_frames", trial.name, message, int(flags.sum()), spans, errors)


def _jump(series: Series) -> float:
    """Return the step that a series does not take in motion."""
    finite = series[np.isfinite(series)]
    steps = np.abs(np.diff(finite))
    return max(10.0 * quantum_of(finite), 2.0 * float(np.quantile(steps, 0.95, method="lower")))


def outliers(trial: Trial) -> Found:
    """The marker jumped elsewhere and back; what recurs at the same phase of each cycle is motion."""
    period = trial.drive.period_s
    flags = np.zeros(len(trial.time), dtype=bool)
    in_an_eighth = trial.drive.block_s / trial.frame_s / 8.0
    window = int(np.clip(in_an_eighth, 3, _OUTLIER_WINDOW)) // 2 * 2 + 1
    for name, series in markers(trial).items():
        keep = np.flatnonzero(trial.used[name])
        if len(keep) < _OUTLIER_WINDOW:
            continue
        limit = max(_OUTLIER_SIGMAS * noise_of(series[keep]), _OUTLIER_RANGE * block_range(trial, name))
        flags[keep] |= _far(trial.time[keep], series[keep], window, limit, period)
    if not flags.any():
        return trial, None
    cleaned = trial.masked(flags, "marker")
    better = bridged(cleaned)
    strayed = [np.abs(trial.signals[name] - series)[flags] for name, series in better.items()]
    farthest = float(np.nanmax(np.concatenate([[0.0], *strayed])))
    measured = np.logical_or.reduce([trial.used[name] for name in markers(trial)])
    share = float(flags.sum() / measured.sum())
    count = int(flags.sum())
    message = (
        f"{counted(count, 'marker sample')} ({share:.1%}) jumped away and back, by up to "
        f"{1e3 * farthest:.3g} mm; masked"
    )
    errors = errors_of(trial, better, flags)
    spans = spans_of(trial.time, flags)
    return cleaned, Defect("marker_outliers", trial.name, message, count, spans, errors, {"share": share})


def _far(time: Series, series: Series, window: int, limit: float, period: float | None) -> Flags:
    """Return which samples stray from the median of their neighbours, the farthest first.

    A sample beside an outlier strays a little in fast motion; it is judged once that is out of the way.
    """
    flags = np.zeros(len(series), dtype=bool)
    judged = flags.copy()
    while True:
        without = np.interp(time, time[~flags], series[~flags])
        away = np.where(judged, 0.0, series - median_filter(without, window, mode="nearest"))
        away[np.abs(away) <= max(limit, 0.5 * np.abs(away).max())] = 0.0
        far = np.flatnonzero(away)
        if len(far) == 0:
            return flags
        judged[far] = True
        motion = np.zeros(len(far), dtype=bool)
        if period is not None:
            motion = _recurring(time, series - median_filter(series, window, mode="nearest"), far, period)
        flags[far[~motion]] = True


def _recurring(time: Series, away: Series, indices: NDArray[np.intp], period: float) -> Flags:
    """Return which excursions are seen, with the same sign, at the same phase of half the other cycles.

    Where excursions to the other side come there half as often, they are no motion either.
    """
    frame = float(np.median(np.diff(np.unique(time))))
    motion = np.zeros(len(indices), dtype=bool)
    for number, index in enumerate(indices):
        turns = np.round((time - time[index]) / period)
        here = (np.abs(time - time[index] - turns * period) <= 1.5 * frame) & (turns != 0.0)
        toward, enough = away * np.sign(away[index]), 0.5 * abs(away[index])
        others = len(np.unique(turns[here]))
        like = len(np.unique(turns[here & (toward > enough)]))
        unlike = len(np.unique(turns[here & (toward < -enough)]))
        motion[number] = others > 0 and like >= 0.5 * others and unlike < 0.5 * like
    return motion


# --- what the search for defects needs --------------------------------------------------------


def noise_of(series: Series) -> float:
    """Return the standard deviation of a series' noise, from its second differences.

    Their median size does not see motion, which is smooth or rare; and a series rounded to a quantum has
    at least the noise of rounding, quantum / sqrt(12).

    Args:
        series: evenly sampled, finite, shape (n,).
    """
    second = np.abs(np.diff(series, 2))
    spread = 1.4826 * float(np.median(second)) / math.sqrt(6.0) if len(second) else 0.0
    return max(spread, quantum_of(series) / math.sqrt(12.0))


def quantum_of(series: Series) -> float:
    """Return the step to which a series is rounded; 0 where its values do not repeat."""
    steps = np.abs(np.diff(series))
    moved = steps[steps > 0.0]
    if len(moved) == 0 or len(moved) > 0.8 * len(steps):
        return 0.0
    return float(np.quantile(moved, 0.05, method="higher"))


def markers(trial: Trial) -> dict[str, Series]:
    """Return the marker's coordinates by signal name."""
    return {name: series for name, series in trial.signals.items() if is_marker(name)}


def block_range(trial: Trial, name: str) -> float:
    """Return how far a signal goes within a block, the median over blocks, in its unit."""
    keep = trial.used[name]
    time, series = trial.time[keep], trial.signals[name][keep]
    number = ((time - time[0]) / trial.drive.block_s).astype(int)
    blocks = np.split(series, np.flatnonzero(np.diff(number)) + 1)
    return float(np.median([np.ptp(block) for block in blocks]))


def runs(flags: Flags) -> list[tuple[int, int]]:
    """Return first index and index after the last of each run of set flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def spans_of(time: Series, flags: Flags) -> tuple[tuple[float, float], ...]:
    """Return first and last time stamp of each run of set flags, s."""
    return tuple((float(time[begin]), float(time[end - 1])) for begin, end in runs(flags))


def bridged(trial: Trial) -> dict[str, Series]:
    """Return the marker's coordinates with those samples interpolated that do not count."""
    return {
        name: np.interp(trial.time, trial.time[trial.used[name]], series[trial.used[name]])
        for name, series in markers(trial).items()
        if trial.used[name].any()
    }


def errors_of(trial: Trial, better: Mapping[str, Series], flags: Flags) -> dict[str, float]:
    """Return the RMS distance over the whole trial of flagged samples from better values, m."""
    errors = {}
    for name, series in better.items():
        excess = np.where(flags, trial.signals[name] - series, 0.0)
        errors[name] = float(np.sqrt(np.nanmean(excess**2)))
    return errors


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, plural where it is not one."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
