"""Frames of a recording that are missing, blank or frozen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.record.defect import Defect, Found, bridged, counted, errors_of, runs, spans_of
from gaitopt.diagnose.record.noise import quantum_of
from gaitopt.diagnose.record.settings import DefectSettings, FrameSettings
from gaitopt.diagnose.record.trial import Flags, Series, Trial


def gaps(trial: Trial, settings: DefectSettings) -> Found:
    """Find frames of a film that are missing, samples of a log that were lost, and samples that are blank."""
    steps, frame = np.diff(trial.time), trial.frame_s
    long = np.flatnonzero(steps > settings.frames.dropped * frame)
    if trial.positions:
        dropped = int(np.round(steps[long] / frame - 1.0).sum())
    else:  # samples of a log that are written late fill the gap before them
        long = long[steps[long] > settings.frames.dropped * frame * _together(steps, long)]
        dropped = int((np.round(steps[long] / frame) - _together(steps, long)).sum())
    blank = np.logical_or.reduce([~np.isfinite(series) for series in trial.signals.values()])
    parts = []
    if dropped:
        longest = long[steps[long].argmax()]
        noun, away = ("frame", "missing") if trial.positions else ("sample", "lost")
        parts.append(
            f"{counted(dropped, noun)} {away} in {counted(len(long), 'gap')}, the longest "
            f"{steps[longest]:.2g} s at t = {trial.time[longest]:.2f} s"
        )
    if blank.any():
        parts.append(f"{counted(int(blank.sum()), 'time stamp')} with a blank sample")
    if not parts:
        return trial, None
    spans = tuple((float(trial.time[i]), float(trial.time[i + 1])) for i in long)
    spans += spans_of(trial.time, blank)
    return trial, Defect("gaps", trial.name, "; ".join(parts), int(blank.sum()), spans)


def _together(steps: Series, indices: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return how many samples share the time stamp after each of some steps."""
    ends = np.append(np.flatnonzero(steps > 0.0), len(steps))
    together: NDArray[np.intp] = ends[np.searchsorted(ends, indices, side="right")] - indices
    return together


def frozen(trial: Trial, settings: DefectSettings) -> Found:
    """Mask frames in which the tracker held its last value while the robot moved on."""
    flags = _frozen_flags(trial, settings.frames)
    if not flags.any():
        return trial, None
    spans = spans_of(trial.time, flags)
    message = (
        f"{counted(int(flags.sum()), 'frame')} frozen (first at t = {spans[0][0]:.2f} s): the tracker held "
        f"its last value and then jumped; masked"
    )
    cleaned = trial.masked(flags)
    errors = errors_of(trial, bridged(cleaned), flags)
    count = int(flags.sum())
    return cleaned, Defect("frozen_frames", trial.name, message, count, spans, errors, component="noise")


def _frozen_flags(trial: Trial, settings: FrameSettings) -> Flags:
    """Return which frames repeat the one before, where the marker jumps afterwards to catch up."""
    same = np.logical_and.reduce([np.diff(series) == 0.0 for series in trial.signals.values()])
    limits = {name: _jump(series, settings) for name, series in trial.positions.items()}
    flags = np.zeros(len(trial.time), dtype=bool)
    for begin, end in runs(same):
        if end - begin < settings.frozen_samples - 1 or end + 1 >= len(trial.time):
            continue
        jumped = [abs(float(s[end + 1] - s[end])) > limits[name] for name, s in trial.positions.items()]
        flags[begin + 1 : end + 1] |= any(jumped)
    return flags


def _jump(series: Series, settings: FrameSettings) -> float:
    """Return the least step that is a jump and not motion, m."""
    finite = series[np.isfinite(series)]
    steps = np.abs(np.diff(finite))
    usual = float(np.quantile(steps, settings.jump_quantile, method="lower"))
    return max(settings.jump_quanta * quantum_of(finite), settings.jump_steps * usual)
