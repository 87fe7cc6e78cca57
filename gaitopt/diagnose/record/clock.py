"""Time stamps that are rounded to a coarse grid, or doubled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaitopt.core.statistics import uniform_sd
from gaitopt.diagnose.record.defect import Defect, Found, bridged, counted, errors_of, spans_of
from gaitopt.diagnose.record.settings import ClockSettings, DefectSettings
from gaitopt.diagnose.record.trial import Series, Trial


def rounded_clock(trial: Trial, settings: DefectSettings) -> Found:
    """Correct time stamps that are rounded to a grid, from some point on.

    Evenly spaced frames get their times back. Where frames are missing, the stamps stay as they are, and the
    trial's clock is known less exactly.
    """
    clock = settings.clock
    found = next(filter(None, (_on_grid(trial.time, grid, clock) for grid in clock.grids_s)), None)
    if found is None:
        return trial, None
    grid, first = found
    even = _even_clock(trial.time, first, grid, clock)
    if even is None:
        return _unsure(trial, first, grid)
    return _restored(trial, first, grid, even)


def doubled_stamps(trial: Trial, _: DefectSettings) -> Found:
    """Mask samples whose time stamp the next one has, too: the last of them counts.

    A log that is written late has such stamps. They are looked for where no position was recorded, as curves
    read off a plot have vertical lines. Stamps that are rounded are another defect.
    """
    doubled = np.append(np.diff(trial.time) == 0.0, False)
    if trial.positions or trial.clock_s > 0.0 or not doubled.any():
        return trial, None
    count = int(doubled.sum())
    message = (
        f"{counted(count, 'time stamp')} doubled, the first at t = {trial.time[doubled][0]:.2f} s: the last "
        "sample of each counts; the others are masked"
    )
    spans = spans_of(trial.time, doubled)
    return trial.masked(doubled), Defect("doubled_stamps", trial.name, message, count, spans)


def _unsure(trial: Trial, first: int, grid: float) -> Found:
    """Return a trial whose stamps stay rounded from index `first` on."""
    message = (
        f"time stamps are rounded to {grid:g} s {_since(trial, first)}, and frames are missing: they stay, "
        f"and timing is known to ±{grid / 2:g} s only"
    )
    unsure = replace(trial, clock_s=uniform_sd(grid))
    return unsure, Defect(
        "clock_rounding", trial.name, message, 0, _span(trial, first), {}, {"grid_s": grid}, "timing"
    )


def _restored(trial: Trial, first: int, grid: float, even: Series) -> Found:
    """Return a trial with even stamps from index `first` on."""
    time = trial.time.copy()
    time[first:] = even
    at_stamps = {name: np.interp(trial.time, time, series) for name, series in bridged(trial).items()}
    errors = errors_of(trial, at_stamps, np.arange(len(time)) >= first)
    message = (
        f"time stamps are rounded to {grid:g} s {_since(trial, first)}; {len(even)} of them were replaced by "
        f"the even clock that they round"
    )
    # A grid that is a multiple of the frame leaves the clock free by one frame.
    restored = replace(trial, time=time, clock_s=uniform_sd(min(grid, float(np.median(np.diff(even))))))
    return restored, Defect(
        "clock_rounding", trial.name, message, 0, _span(trial, first), errors, {"grid_s": grid}, "timing"
    )


def _since(trial: Trial, first: int) -> str:
    return "throughout" if first == 0 else f"from t = {trial.time[first]:.2f} s on"


def _span(trial: Trial, first: int) -> tuple[tuple[float, float], ...]:
    return ((float(trial.time[first]), float(trial.time[-1])),)


def _even_clock(time: Series, first: int, grid: float, settings: ClockSettings) -> Series | None:
    """Return evenly spaced times that round to the stamps from index `first` on, s; None if none do.

    They continue the frames before them where there are enough, or else follow the line through the stamps.
    """
    stamps = time[first:]
    order = np.arange(len(stamps), dtype=float)
    if first >= settings.least_steps:
        slope, begin = np.polyfit(np.arange(first), time[:first], 1)
        even: Series = begin + slope * (first + order)
        if np.abs(even - stamps).max() <= settings.continued * grid:
            return even
    even = np.polyval(np.polyfit(order, stamps, 1), order)
    if np.abs(even - stamps).max() > settings.fitted * grid:
        return None
    return np.maximum(even, time[first - 1]) if first else even


def _on_grid(time: Series, grid: float, settings: ClockSettings) -> tuple[float, int] | None:
    """Return the grid and the index from which on all time stamps lie on it, unevenly; else None."""
    off = np.abs(time - grid * np.round(time / grid)) > settings.on_grid_s
    first = int(np.flatnonzero(off)[-1]) + 1 if off.any() else 0
    steps = np.round(np.diff(time[first:]) / grid).astype(int)
    if len(steps) < settings.least_steps or not steps.any():
        return None
    frame = float(steps.mean())
    low = int(frame)
    shares = [float(np.mean(steps == low)), float(np.mean(steps == low + 1))]
    rounded = min(shares) >= settings.rare_step and sum(shares) >= settings.two_steps
    uneven = rounded and _even_clock(time, first, grid, settings) is not None
    repeated = float(np.mean(steps == 0)) >= settings.repeated
    return (grid, first) if settings.least_grid * frame <= 1.0 and (uneven or repeated) else None
