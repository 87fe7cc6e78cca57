"""Samples of the marker that jump elsewhere and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from gaitopt.diagnose.record.defect import Defect, Found, bridged, counted, errors_of, spans_of
from gaitopt.diagnose.record.noise import block_range, noise_of
from gaitopt.diagnose.record.settings import DefectSettings, OutlierSettings
from gaitopt.diagnose.record.trial import Flags, Series, Trial


def outliers(trial: Trial, settings: DefectSettings) -> Found:
    """Mask samples of the marker that jump elsewhere and back.

    What recurs at the same phase of each cycle is motion, where the drive has a period.
    """
    flags = _outlier_flags(trial, settings.outliers)
    if not flags.any():
        return trial, None
    cleaned = trial.masked(flags, trial.positions)
    better = bridged(cleaned)
    strayed = [np.abs(trial.signals[name] - series)[flags] for name, series in better.items()]
    farthest = float(np.nanmax(np.concatenate([[0.0], *strayed])))
    measured = np.logical_or.reduce([trial.used[name] for name in trial.positions])
    share = float(flags.sum() / measured.sum())
    count = int(flags.sum())
    message = (
        f"{counted(count, 'marker sample')} ({share:.1%}) jumped away and back, by up to "
        f"{1e3 * farthest:.3g} mm; masked"
    )
    errors = errors_of(trial, better, flags)
    spans = spans_of(trial.time, flags)
    return cleaned, Defect(
        "marker_outliers", trial.name, message, count, spans, errors, {"share": share}, "noise"
    )


def _outlier_flags(trial: Trial, settings: OutlierSettings) -> Flags:
    """Return which samples are outliers in any coordinate of the marker."""
    flags = np.zeros(len(trial.time), dtype=bool)
    in_a_block = trial.drive.block_s / trial.frame_s / settings.windows_per_block
    window = int(np.clip(in_a_block, settings.least_window, settings.window)) // 2 * 2 + 1
    for name in trial.positions:
        keep = np.flatnonzero(trial.used[name])
        if len(keep) < settings.window:
            continue
        time, series = trial.time[keep], trial.signals[name][keep]
        limit = max(settings.sigmas * noise_of(series), settings.range_share * block_range(trial, name))
        flags[keep] |= _far(time, series, window, limit, trial.drive.period_s, settings)
    return flags


def _far(
    time: Series, series: Series, window: int, limit: float, period: float | None, settings: OutlierSettings
) -> Flags:
    """Return which samples are far from the median of their neighbours.

    The farthest are judged first. In fast motion a sample next to an outlier is a little off too, so it is
    judged after that outlier is removed.

    Args:
        time: time stamps of the samples that count, s, shape (n,).
        series: their values, m, shape (n,).
        window: samples of which a median is taken, odd.
        limit: least distance of an outlier, m.
        period: of the drive, s, if it has one.
        settings: see `OutlierSettings`.
    """
    flags = np.zeros(len(series), dtype=bool)
    judged = flags.copy()
    while True:
        without = np.interp(time, time[~flags], series[~flags])
        away = np.where(judged, 0.0, series - median_filter(without, window, mode="nearest"))
        away[np.abs(away) <= max(limit, settings.farthest * np.abs(away).max())] = 0.0
        far = np.flatnonzero(away)
        if len(far) == 0:
            return flags
        judged[far] = True
        motion = np.zeros(len(far), dtype=bool)
        if period is not None:
            around = series - median_filter(series, window, mode="nearest")
            motion = _recurring(time, around, far, period, settings)
        flags[far[~motion]] = True


def _recurring(
    time: Series, away: Series, indices: NDArray[np.intp], period: float, settings: OutlierSettings
) -> Flags:
    """Return which excursions recur with the same sign at the same phase of enough other cycles.

    If excursions to the other side are there half as often, they are not motion either.
    """
    frame = float(np.median(np.diff(np.unique(time))))
    motion = np.zeros(len(indices), dtype=bool)
    for number, index in enumerate(indices):
        turns = np.round((time - time[index]) / period)
        here = (np.abs(time - time[index] - turns * period) <= settings.near_frames * frame) & (turns != 0.0)
        toward, enough = away * np.sign(away[index]), settings.alike * abs(away[index])
        others = len(np.unique(turns[here]))
        like = len(np.unique(turns[here & (toward > enough)]))
        unlike = len(np.unique(turns[here & (toward < -enough)]))
        motion[number] = others > 0 and like >= settings.recurring * others and unlike < 0.5 * like
    return motion
