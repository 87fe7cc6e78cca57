"""Measured angles: sensors that jump by a turn, and sensors of a coarse step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gaitopt.core.statistics import uniform_sd
from gaitopt.diagnose.record.defect import Defect, Found, counted
from gaitopt.diagnose.record.settings import AngleSettings, DefectSettings
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.robot.signals import kind_of

TURN = 2.0 * math.pi
"""Range of a sensor that reads one turn, rad: 360°, or 4096 counts of a usual encoder."""

_DIGITS = 9
"""Digits of an angle in rad that are compared: the rest is rounding of sums."""

_FAR = 0.6
"""An unwrapped angle is moved by a turn if it is further from 0 than this, in turns."""


def wrapped_angles(trial: Trial, settings: DefectSettings) -> Found:
    """Unwrap angles that jump by a turn where their sensor goes from one end of its range to the other."""
    signals, parts, places = dict(trial.signals), [], []
    for name in trial.angles:
        keep = np.flatnonzero(trial.used[name])
        jumps = _jumps(trial.signals[name][keep], settings.angles)
        if not jumps.any():
            continue
        straight = trial.signals[name][keep] - TURN * np.cumsum(np.append(0.0, jumps))
        moved = _turns_off(name, straight)
        signals[name] = trial.signals[name].copy()
        signals[name][keep] = straight - TURN * moved
        at = keep[np.flatnonzero(jumps)]
        places += [(float(trial.time[i]), float(trial.time[i + 1])) for i in at]
        count = "once" if len(at) == 1 else f"{len(at)} times"
        aside = f", and moved by {counted(abs(moved), 'turn')} toward 0" if moved else ""
        first = f"first at t = {trial.time[at[0]]:.2f} s"
        parts.append(f"{name} jumps by a turn {count}, {first}: unwrapped{aside}")
    if not parts:
        return trial, None
    straightened = replace(trial, signals=signals)
    sizes = {"range_rad": TURN}
    return straightened, Defect("wrapped_angles", trial.name, "; ".join(parts), 0, tuple(places), {}, sizes)


def _turns_off(name: str, series: Series) -> int:
    """Return by how many turns an unwrapped angle is off.

    A joint turns to either side of angle 0, about which its range lies. A site may turn on and on; the
    simulated one begins within half a turn of 0.
    """
    place = float(series[0]) if kind_of(name) == "site" else 0.5 * float(series.max() + series.min())
    return round(place / TURN) if abs(place) > _FAR * TURN else 0


def _jumps(series: Series, settings: AngleSettings) -> Series:
    """Return the whole turns in the steps between samples, shape (n - 1,): 0, 1 or -1.

    Args:
        series: an angle, rad, finite, shape (n,).
        settings: see `AngleSettings`.
    """
    steps = np.diff(series) / TURN
    jumps = np.where(np.abs(np.abs(steps) - 1.0) <= settings.turn, np.sign(steps), 0.0)
    still = np.abs(steps[jumps == 0.0]) <= settings.moving
    return jumps if still.all() else np.zeros(len(steps))


def coarse_angles(trial: Trial, settings: DefectSettings) -> Found:
    """Find angles whose sensor has coarse steps. They count as noise of a step over the root of 12."""
    found = {}
    for name in trial.angles:
        _, series = trial.counted(name)
        step = step_of(series, settings.angles)
        levels = round(float(np.ptp(series)) / step) if step > 0.0 else 0
        if settings.angles.least_levels <= levels <= settings.angles.levels:
            found[name] = step
    if not found:
        return trial, None
    parts = [
        f"{name} has steps of {step:.3g} rad ({math.degrees(step):.3g}°), "
        f"{np.ptp(trial.counted(name)[1]) / step:.0f} in its whole motion: counts as noise of "
        f"{uniform_sd(step):.2g} rad"
        for name, step in found.items()
    ]
    sizes = {"step_rad": max(found.values())}
    defect = Defect("coarse_angles", trial.name, "; ".join(parts), parameters=sizes, component="noise")
    return replace(trial, steps_rad=found), defect


def step_of(series: Series, settings: AngleSettings) -> float:
    """Return the step of which all differences between samples are multiples; 0 where there is none.

    Args:
        series: finite, shape (n,).
        settings: see `AngleSettings`.
    """
    apart = np.diff(np.unique(np.round(series, _DIGITS)))
    if len(apart) == 0 or len(apart) + 1 > settings.distinct * len(series):
        return 0.0
    rough = float(apart[apart < 1.5 * apart.min()].mean())
    multiples = np.round(apart / rough)
    step = float(apart.sum() / multiples.sum())  # better than one difference: each was rounded
    return step if np.abs(apart / step - multiples).max() <= settings.on_step else 0.0
