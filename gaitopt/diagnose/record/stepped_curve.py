"""Curves read off a plot whose time stamps were rounded: they move only at the lines of a grid."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from gaitopt.diagnose.record.defect import Defect, Found, counted, errors_of
from gaitopt.diagnose.record.noise import block_range, noise_of
from gaitopt.diagnose.record.settings import DefectSettings, SteppedCurveSettings
from gaitopt.diagnose.record.trial import Flags, Series, Trial


def stepped_curve(trial: Trial, settings: DefectSettings) -> Found:
    """Mask what a curve shows after its time stamps begin to be rounded to a grid.

    It is looked for in trials of a drive with a period only.
    """
    period, stepped = trial.drive.period_s, settings.stepped_curve
    if period is None:
        return trial, None
    for grid in settings.clock.grids_s:
        if not stepped.frames_per_grid * trial.frame_s < grid <= period / stepped.grids_per_period:
            continue
        for name in trial.positions:
            begin = _stepped_from(trial, name, grid, stepped)
            if begin is not None:
                return _masked(trial, grid, begin, stepped)
    return trial, None


def _masked(trial: Trial, grid: float, begin: float, settings: SteppedCurveSettings) -> Found:
    """Return a trial without its samples from `begin` on, s."""
    flags = trial.time >= begin
    better = {other: _between_lines(trial, other, grid, flags, settings) for other in trial.positions}
    count = int(flags.sum())
    message = (
        f"time stamps are rounded to {grid:g} s from t = {begin:.2f} s on: the curve moves at "
        f"multiples of {grid:g} s alone; {counted(count, 'sample')} masked"
    )
    spans = ((float(trial.time[flags][0]), float(trial.time[-1])),)
    errors = errors_of(trial, better, flags)
    return trial.masked(flags), Defect(
        "clock_rounding", trial.name, message, count, spans, errors, {"grid_s": grid}, "timing"
    )


def _stepped_from(trial: Trial, name: str, grid: float, settings: SteppedCurveSettings) -> float | None:
    """Return the time from which a signal moves only at multiples of `grid`, s, or None."""
    time, series = trial.counted(name)
    if len(time) < 2:  # nothing is left of it
        return None
    middle = 0.5 * (time[1:] + time[:-1])
    moved = np.abs(np.diff(median_filter(series, 3, mode="nearest")))  # a line's ends are read in any order
    line = np.round(middle / grid).astype(int)
    near = np.abs(middle - grid * line) <= settings.line * grid
    first, count = int(line[0]), int(line[-1] - line[0]) + 1
    whole = np.bincount(line - first, moved, minlength=count)
    at_line = np.bincount(line - first, moved * near, minlength=count)
    moving = np.flatnonzero(whole > settings.moving * block_range(trial, name))
    smooth = np.flatnonzero(at_line[moving] <= settings.cell_stepped * whole[moving])
    tail = moving[smooth[-1] + 1 :] if len(smooth) else moving
    steps = np.bincount(line - first, minlength=count)
    sure = tail[whole[tail] > settings.noise_path * noise_of(series) * steps[tail]]
    in_a_row = int((np.diff(sure) == 1).sum()) + 1
    few = len(sure) < settings.cells or in_a_row < settings.in_a_row
    if few or at_line[tail].sum() < settings.stepped * whole[tail].sum():
        return None
    return float((tail[0] + first - 0.5) * grid)


def _between_lines(
    trial: Trial, name: str, grid: float, flags: Flags, settings: SteppedCurveSettings
) -> Series:
    """Return a stepped signal whose flagged part is drawn through the middles of its plateaus, m."""
    time, series = trial.time, trial.signals[name]
    cell = np.floor(time / grid).astype(int)
    inside = flags & (np.abs(time / grid - cell - 0.5) < 0.5 - settings.line) & np.isfinite(series)
    cells = np.unique(cell[inside])
    levels = [float(np.median(series[inside & (cell == c)])) for c in cells]
    keep = ~flags & np.isfinite(series)
    knots = np.concatenate([time[keep], (cells + 0.5) * grid])
    values = np.concatenate([series[keep], levels])
    order = np.argsort(knots, kind="stable")
    drawn: Series = np.interp(time, knots[order], values[order])
    return drawn
