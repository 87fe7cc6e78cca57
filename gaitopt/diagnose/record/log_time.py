"""Time stamps of logs: their unit, their zero, and a clock that was set back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.units import TIME
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.tables import LARGEST
from gaitopt.diagnose.record.trial import Series

LARGEST_STAMP = 1e19
"""No clock gives a larger number: nanoseconds since 1970 have 19 digits."""

_NAMES = ("t", "time", "timestamp", "time_stamp", "stamp", "ts")

_EPOCH_S = (1e9, 4e9)
"""Seconds since 1970 lie between these: the years 2001 to 2096."""

_LONGEST_STEP_S = 1.0
"""Logs of motion have more than one sample a second; longer steps are another unit."""

_SWAPPED = 1.5
"""A row may be out of order if the stamp before it comes later than this many usual steps."""


def is_time(column: str) -> bool:
    """Return whether a column's name says that it holds time stamps: ``t_s``, ``time_ms``, ``timestamp``."""
    stem, _, unit = column.rpartition("_")
    return column in _NAMES or (stem in _NAMES and unit in TIME)


def log_seconds(source: object, column: str, stamps: Series, unit: str | None) -> tuple[Series, float]:
    """Return time stamps in s, and the stamp that is their zero, s: the first, if they count from 1970.

    The unit is the suffix of the column's name; else the one given; else that in which the stamps are of our
    time; else seconds.

    Args:
        source: the log, for messages.
        column: name of the stamps.
        stamps: as they are logged, shape (n,).
        unit: their unit where the name has none, if it is known.

    Raises:
        GaitoptError: no unit fits, or a number is none of a clock.
    """
    suffix = column.rpartition("_")[2]
    if unit is not None and unit not in TIME:
        raise bad_value(source, "--time-unit", unit, ", ".join(TIME), TIME)
    known = suffix if column not in _NAMES and suffix in TIME else unit
    scale = TIME[known or _unit_of(stamps)]
    first = float(stamps[0]) if len(stamps) else 0.0
    zero = first if _EPOCH_S[0] <= first * scale <= _EPOCH_S[1] else 0.0
    time: Series = (stamps - zero) * scale
    if (np.abs(time) > LARGEST).any():
        raise GaitoptError(
            f"{source}: {column}: found {np.abs(time).max():.3g} s; allowed: at most {LARGEST:g}"
        )
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    if known is None and usual > _LONGEST_STEP_S:
        raise GaitoptError(
            f"{source}: {column}: samples are {usual:.4g} s apart if they are seconds; say their unit: "
            f"--time-unit {', '.join(TIME)}"
        )
    return time, zero * scale


def _unit_of(stamps: Series) -> str:
    """Return the unit in which the first stamp is a date of our time; seconds where there is none."""
    first = float(stamps[0]) if len(stamps) else 0.0
    return next((unit for unit in TIME if _EPOCH_S[0] <= first * TIME[unit] <= _EPOCH_S[1]), "s")


def forward_clock(
    source: object, name: str, time: Series, lines: NDArray[np.int64]
) -> tuple[Series, Defect | None]:
    """Return time stamps that never go backward, after a clock that was set back once.

    A network's time or a counter that overflows sets a clock back. How long that step took is not known; it
    is taken for a usual one.

    Args:
        source: the log, for messages.
        name: name of the trial.
        time: time stamps, s, shape (n,), finite.
        lines: line of each in the log, shape (n,).

    Raises:
        GaitoptError: time goes backward more than once, or a row is out of order.
    """
    steps = np.diff(time)
    backward = np.flatnonzero(steps < 0.0)
    if len(backward) == 0 or not (steps > 0.0).any():
        return time, None
    at, usual = int(backward[0]), float(np.median(steps[steps > 0.0]))
    line = int(lines[at + 1])
    if len(backward) > 1:
        raise GaitoptError(
            f"{source}: time goes backward {len(backward)} times, first at line {line}, from {time[at]:g} to "
            f"{time[at + 1]:g} s; allowed: once"
        )
    if at > 0 and steps[at - 1] > _SWAPPED * usual and (time[at + 2 :] > time[at]).all():
        raise GaitoptError(f"{source}: line {line} is out of order; sort the lines by time")
    moved = time.copy()
    moved[at + 1 :] += usual - steps[at]
    message = (
        f"the clock goes backward by {-steps[at]:.4g} s at line {line} (t = {time[at]:.2f} s): what "
        f"follows is moved later, to a usual step of {usual:.3g} s after it"
    )
    spans = ((float(moved[at]), float(moved[at + 1])),)
    sizes = {"back_s": float(-steps[at]), "line": float(line)}
    return moved, Defect("clock_set_back", name, message, 0, spans, parameters=sizes)
