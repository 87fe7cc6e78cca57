"""Angles of a sensor that is stuck: it repeats a value while its joint moves on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaitopt.diagnose.record.angles import step_of
from gaitopt.diagnose.record.defect import Defect, Found, counted, runs, spans_of
from gaitopt.diagnose.record.settings import AngleSettings, DefectSettings
from gaitopt.diagnose.record.trial import Flags, Series, Trial
from gaitopt.gait.logged import LoggedCommands


def stuck_angles(trial: Trial, settings: DefectSettings) -> Found:
    """Mask samples of an angle that repeat a value before a jump, as a sensor that was stuck makes it.

    An angle that never changes again though commands do is named, and stays: the joint may be blocked.
    """
    used, parts, every = dict(trial.used), [], np.zeros(len(trial.time), dtype=bool)
    for name in trial.angles:
        keep = np.flatnonzero(trial.used[name])
        series = trial.signals[name][keep]
        flags = np.zeros(len(trial.time), dtype=bool)
        flags[keep] = _held_before_a_jump(series, settings.angles)
        if flags.any():
            used[name], every = used[name] & ~flags, every | flags
            begin = spans_of(trial.time, flags)[0][0]
            said = f"{counted(int(flags.sum()), 'sample')} of {name} stuck, first at t = {begin:.2f} s"
            parts.append(f"{said}: the same value, and then a jump; masked")
        since = _never_changes(trial, trial.time[keep], series, settings.angles)
        if since is not None:
            said = f"{name} never changes from t = {since:.2f} s on, though the commands do"
            parts.append(f"{said}: a stuck sensor, or a joint that is blocked")
    if not parts:
        return trial, None
    spans = spans_of(trial.time, every)
    defect = Defect("stuck_angles", trial.name, "; ".join(parts), int(every.sum()), spans, component="noise")
    return replace(trial, used=used), defect


def _held_before_a_jump(series: Series, settings: AngleSettings) -> Flags:
    """Return which samples repeat a value that is followed by a jump, shape (n,).

    Args:
        series: finite, shape (n,).
        settings: see `AngleSettings`.
    """
    flags, steps = np.zeros(len(series), dtype=bool), np.abs(np.diff(series))
    held = [(a, b) for a, b in runs(steps == 0.0) if b - a >= settings.stuck_samples - 1 and b < len(steps)]
    others = np.delete(steps, [end for _, end in held])
    if not held or len(others) == 0:
        return flags
    least = max(settings.jump * float(others.max()), settings.jump_steps * step_of(series, settings))
    jumps = [(begin, end) for begin, end in held if steps[end] > least]
    if steps[[end for _, end in jumps]].sum() > settings.jumped * steps.sum():
        return flags
    for begin, end in jumps:
        flags[begin + 1 : end + 1] = True
    return flags


def _never_changes(trial: Trial, time: Series, series: Series, settings: AngleSettings) -> float | None:
    """Return the time from which an angle never changes though each channel is commanded to move, s.

    None where there is none, and where the commands are not known or a servo is unpowered.

    Args:
        trial: the recording.
        time: time stamps of the angle's samples, s, shape (n,).
        series: the angle, rad, finite, shape (n,).
        settings: see `AngleSettings`.
    """
    drive = trial.drive
    if not isinstance(drive, LoggedCommands) or trial.starts_at_s is None or len(series) == 0:
        return None
    changed = np.flatnonzero(np.diff(series))
    since = float(time[changed[-1] + 1 if len(changed) else 0])
    asked = time[(time >= since) & (time <= time[-1] - settings.answer_s)]
    if len(asked) < settings.stuck_samples:
        return None
    targets = drive.targets(asked + trial.starts_at_s)
    least = max(settings.commanded * float(np.ptp(series)), settings.least_commanded_rad)
    return since if (np.ptp(targets, axis=0) >= least).all() else None
