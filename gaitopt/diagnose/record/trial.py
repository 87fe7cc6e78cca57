"""A trial: one recording, and what was commanded while it was made."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.drive import Drive
from gaitopt.robot.signals import is_position

Series = NDArray[np.float64]
"""One number per sample, shape (n,) unless said otherwise."""

Flags = NDArray[np.bool_]
"""Which samples are concerned, shape (n,)."""


@dataclass(frozen=True)
class Trial:
    """One recording.

    Attributes:
        name: name of the trial.
        drive: what was commanded.
        time: time stamps on the recording's own clock, s, shape (n,), never decreasing. Several samples may
            share one stamp, as in curves read off a plot with vertical lines.
        signals: measured series, each of shape (n,): ``marker.x|y|z`` and ``site.NAME.x|y|z`` in m, of
            arbitrary origin, ``joint.NAME`` and ``site.NAME.roll|pitch|yaw`` in rad; NaN where nothing was
            measured.
        used: for each signal which samples count, shape (n,): measured, and not masked as a defect.
        starts_at_s: gait time at the recording's zero, s; None where it is not known.
        noise_m: standard deviation of the marker's noise, m, if it is known.
        fps: frames a second, if known.
        clock_s: standard deviation of the common error of time stamps that had been rounded, s.
        steps_rad: step of each angle whose sensor is coarse, rad.
    """

    name: str
    drive: Drive
    time: Series
    signals: Mapping[str, Series]
    used: Mapping[str, Flags]
    starts_at_s: float | None = None
    noise_m: float | None = None
    fps: float | None = None
    clock_s: float = 0.0
    steps_rad: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def of(name: str, drive: Drive, time: Series, signals: Mapping[str, Series]) -> Trial:
        """Return a trial in which every finite sample counts."""
        used = {signal: np.isfinite(series) for signal, series in signals.items()}
        return Trial(name, drive, time, signals, used)

    @property
    def has_log(self) -> bool:
        """Whether what was commanded has no period, as a log of commands; it has no figures of cycles."""
        return self.drive.period_s is None

    @property
    def frame_s(self) -> float:
        """Typical time between two samples, s."""
        steps = np.diff(self.time)
        return float(np.median(steps[steps > 0.0]))

    @property
    def positions(self) -> dict[str, Series]:
        """The coordinates of the marker and of sites by signal, m."""
        return {name: series for name, series in self.signals.items() if is_position(name)}

    @property
    def angles(self) -> list[str]:
        """The signals that are angles, of joints or of sites."""
        return [name for name in self.signals if not is_position(name)]

    def counted(self, signal: str) -> tuple[Series, Series]:
        """Return time stamps, s, and values of those samples of a signal that count."""
        keep = self.used[signal]
        return self.time[keep], self.signals[signal][keep]

    def first(self, count: int) -> Trial:
        """Return the trial with its first samples alone."""
        signals = {name: series[:count] for name, series in self.signals.items()}
        used = {name: keep[:count] for name, keep in self.used.items()}
        return replace(self, time=self.time[:count], signals=signals, used=used)

    def masked(self, flags: Flags, signals: Collection[str] | None = None) -> Trial:
        """Return the trial without some samples, of every signal or of those named."""
        used = {
            name: keep & ~flags if signals is None or name in signals else keep
            for name, keep in self.used.items()
        }
        return replace(self, used=used)
