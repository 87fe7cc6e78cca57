"""A defect: one thing that is wrong with a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import numpy as np

from gaitopt.diagnose.record.trial import Flags, Series, Trial


@dataclass(frozen=True)
class Defect:
    """One thing that is wrong with a recording.

    Attributes:
        name: ``gaps``, ``frozen_frames``, ``marker_outliers``, ``clock_rounding``, ``wrong_frame_rate``,
            ``wrong_unit``, ``axis_reversed``, ``commands_beyond_range``, ``doubled_stamps``,
            ``wrapped_angles``, ``stuck_angles``, ``coarse_angles``, ``another_gait`` or ``stands_still``; of
            imported files also ``unlikely_points``, ``pixels``, ``side_view``, ``clock_zero``,
            ``clock_set_back`` and ``late_commands``.
        trial: name of the trial.
        message: what was found, and what was done about it.
        masked: number of time stamps with samples that do not count.
        spans_s: first and last time stamp of each stretch concerned, s, on the recording's clock.
        errors_m: RMS error over the whole trial that the defect put into each coordinate of the marker, m, as
            far as the record itself shows it.
        parameters: size of the defect by name: ``share``, ``grid_s``, ``ratio`` or ``scale_m_per_px``.
        component: component of the gap that the error belongs to, if any; see `split.COMPONENTS`.
    """

    name: str
    trial: str
    message: str
    masked: int = 0
    spans_s: tuple[tuple[float, float], ...] = ()
    errors_m: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    component: str | None = None

    @property
    def error_m(self) -> float:
        """RMS error that the defect put into the marker's record, m."""
        return math.hypot(*self.errors_m.values())

    def to_dict(self) -> dict[str, object]:
        """Return the defect for a JSON file."""
        content = asdict(self) | {"error_m": self.error_m}
        del content["component"]
        return content


Found = tuple[Trial, Defect | None]
"""The trial after a defect was masked or corrected, and the defect; the same trial and None without one."""


def runs(flags: Flags) -> list[tuple[int, int]]:
    """Return first index and index after the last of each run of set flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def spans_of(time: Series, flags: Flags) -> tuple[tuple[float, float], ...]:
    """Return first and last time stamp of each run of set flags, s."""
    return tuple((float(time[begin]), float(time[end - 1])) for begin, end in runs(flags))


def bridged(trial: Trial) -> dict[str, Series]:
    """Return the marker's coordinates, interpolated over the samples that do not count, m."""
    return {
        name: np.interp(trial.time, *trial.counted(name))
        for name in trial.positions
        if trial.used[name].any()
    }


def errors_of(trial: Trial, better: Mapping[str, Series], flags: Flags) -> dict[str, float]:
    """Return the RMS distance of flagged samples from better values, over the whole trial, m."""
    errors = {}
    for name, series in better.items():
        excess = np.where(flags, trial.signals[name] - series, 0.0)
        errors[name] = float(np.sqrt(np.nanmean(excess**2)))
    return errors


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, in the plural unless the number is one."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
