"""Time stamps rounded to a coarse grid: corrected where frames are even, masked where they are not told."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from gaitopt.diagnose.record.defects import (
    Defect,
    Found,
    block_range,
    bridged,
    counted,
    errors_of,
    markers,
    noise_of,
)
from gaitopt.diagnose.record.trial import Flags, Series, Trial

GRIDS_S = (1.0, 0.5, 0.25, 0.2, 0.1, 0.05, 0.04, 0.025, 0.02, 0.01, 0.005)
"""Grids that clocks are rounded to, coarsest first, s."""

_COARSE = 0.25
"""A grid matters if it is at least this share of the time between frames."""

_STRETCH = 12
"""Fewer steps than this tell nothing."""

_LINE = 0.2
_CELL_STEPPED, _STEPPED, _CELLS, _IN_A_ROW = 0.6, 0.7, 6, 3
"""A curve is stepped if this much of its motion lies within `_LINE` of a grid's lines: in each cell, and in
all; a smooth one has 0.4. So many cells must show it, and so many of them in a row: gaits have edges on a
grid too, and three cells of a smooth walk may look like this."""

_MOVING = 0.05
"""A cell moves if it moves by this share of what a cycle goes through."""

_NOISE_PATH = 1.0
"""But one that moves by no more than this, in standard deviations of noise a sample, may stand still: the
way back and forth of noise alone is half of it."""


def rounded_clock(trial: Trial) -> Found:
    """Time stamps rounded to a grid from some point on; evenly spaced frames get their times back."""
    found = next(filter(None, (_on_grid(trial.time, grid) for grid in GRIDS_S)), None)
    if found is None:
        return trial, None
    grid, first = found
    stamps = trial.time[first:]
    even = _even_clock(trial.time, first, grid)
    where = "throughout" if first == 0 else f"from t = {stamps[0]:.2f} s on"
    spans = ((float(stamps[0]), float(stamps[-1])),)
    if even is None:
        message = (
            f"time stamps are rounded to {grid:g} s {where}, and frames are missing: they stay, and "
            f"timing is known to ±{grid / 2:g} s only"
        )
        unsure = replace(trial, clock_s=grid / math.sqrt(12.0))
        return unsure, Defect("clock_rounding", trial.name, message, 0, spans, {}, {"grid_s": grid})
    time = trial.time.copy()
    time[first:] = even
    at_stamps = {name: np.interp(trial.time, time, series) for name, series in bridged(trial).items()}
    errors = errors_of(trial, at_stamps, np.arange(len(time)) >= first)
    message = (
        f"time stamps are rounded to {grid:g} s {where}; {len(stamps)} of them were replaced by the even "
        f"clock that they round"
    )
    # A grid that is a multiple of the frame leaves the clock free by one frame.
    restored = replace(trial, time=time, clock_s=min(grid, float(np.median(np.diff(even)))) / math.sqrt(12.0))
    return restored, Defect("clock_rounding", trial.name, message, 0, spans, errors, {"grid_s": grid})


def _even_clock(time: Series, first: int, grid: float) -> Series | None:
    """Return evenly spaced times that round to the stamps from index `first` on, s; None if none do.

    The frames before them go on, or else the line through the stamps is taken.
    """
    stamps = time[first:]
    order = np.arange(len(stamps), dtype=float)
    if first >= _STRETCH:
        slope, begin = np.polyfit(np.arange(first), time[:first], 1)
        even: Series = begin + slope * (first + order)
        if np.abs(even - stamps).max() <= 0.55 * grid:
            return even
    even = np.polyval(np.polyfit(order, stamps, 1), order)
    if np.abs(even - stamps).max() > 0.75 * grid:
        return None
    return np.maximum(even, time[first - 1]) if first else even


def _on_grid(time: Series, grid: float) -> tuple[float, int] | None:
    """Return the grid and the index from which on all time stamps lie on it, unevenly; else None."""
    off = np.abs(time - grid * np.round(time / grid)) > 1e-6
    first = int(np.flatnonzero(off)[-1]) + 1 if off.any() else 0
    steps = np.round(np.diff(time[first:]) / grid).astype(int)
    if len(steps) < _STRETCH or not steps.any():
        return None
    frame = float(steps.mean())
    low = int(frame)
    shares = [float(np.mean(steps == low)), float(np.mean(steps == low + 1))]
    uneven = min(shares) >= 0.1 and sum(shares) >= 0.9 and _even_clock(time, first, grid) is not None
    repeated = float(np.mean(steps == 0)) >= 0.2
    return (grid, first) if _COARSE * frame <= 1.0 and (uneven or repeated) else None


def stepped_clock(trial: Trial) -> Found:
    """Rounded time stamps in a curve read off a plot: it moves at the grid's lines alone."""
    period = trial.drive.period_s
    if period is None:
        return trial, None
    for grid in GRIDS_S:
        if not 4.0 * trial.frame_s < grid <= period / 8.0:
            continue
        for name in markers(trial):
            begin = _stepped_from(trial, name, grid)
            if begin is None:
                continue
            flags = trial.time >= begin
            better = {other: _between_lines(trial, other, grid, flags) for other in markers(trial)}
            count = int(flags.sum())
            message = (
                f"time stamps are rounded to {grid:g} s from t = {begin:.2f} s on: the curve moves at "
                f"multiples of {grid:g} s alone; {counted(count, 'sample')} masked"
            )
            spans = ((float(trial.time[flags][0]), float(trial.time[-1])),)
            errors = errors_of(trial, better, flags)
            return trial.masked(flags), Defect(
                "clock_rounding", trial.name, message, count, spans, errors, {"grid_s": grid}
            )
    return trial, None


def _stepped_from(trial: Trial, name: str, grid: float) -> float | None:
    """Return the time from which on a signal moves at multiples of `grid` alone, s, or None."""
    keep = trial.used[name]
    time, series = trial.time[keep], trial.signals[name][keep]
    middle = 0.5 * (time[1:] + time[:-1])
    moved = np.abs(np.diff(median_filter(series, 3, mode="nearest")))  # a line's ends are read in any order
    line = np.round(middle / grid).astype(int)
    near = np.abs(middle - grid * line) <= _LINE * grid
    first, count = int(line[0]), int(line[-1] - line[0]) + 1
    whole = np.bincount(line - first, moved, minlength=count)
    at_line = np.bincount(line - first, moved * near, minlength=count)
    moving = np.flatnonzero(whole > _MOVING * block_range(trial, name))
    smooth = np.flatnonzero(at_line[moving] <= _CELL_STEPPED * whole[moving])
    tail = moving[smooth[-1] + 1 :] if len(smooth) else moving
    steps = np.bincount(line - first, minlength=count)
    sure = tail[whole[tail] > _NOISE_PATH * noise_of(series) * steps[tail]]
    in_a_row = int((np.diff(sure) == 1).sum()) + 1
    few = len(sure) < _CELLS or in_a_row < _IN_A_ROW
    if few or at_line[tail].sum() < _STEPPED * whole[tail].sum():
        return None
    return float((tail[0] + first - 0.5) * grid)


def _between_lines(trial: Trial, name: str, grid: float, flags: Flags) -> Series:
    """Return a stepped signal whose flagged part is drawn through the middles of its plateaus."""
    time, series = trial.time, trial.signals[name]
    cell = np.floor(time / grid).astype(int)
    inside = flags & (np.abs(time / grid - cell - 0.5) < 0.5 - _LINE) & np.isfinite(series)
    cells = np.unique(cell[inside])
    levels = [float(np.median(series[inside & (cell == c)])) for c in cells]
    keep = ~flags & np.isfinite(series)
    knots = np.concatenate([time[keep], (cells + 0.5) * grid])
    values = np.concatenate([series[keep], levels])
    order = np.argsort(knots, kind="stable")
    drawn: Series = np.interp(time, knots[order], values[order])
    return drawn
