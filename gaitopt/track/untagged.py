"""Films without tags: one point, in the plane of the picture, on the scale of a known length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.quantities import figure
from gaitopt.core.statistics import noise_sd
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import VIEWS
from gaitopt.track.film import facts_of, pictures
from gaitopt.track.follow import Dot, DotFollower, Patch, PatchFollower
from gaitopt.track.sync import UNKNOWN, Beginning, FrameMark, Lamp, LampMark, Sync, TimeMark

Array = NDArray[np.float64]

_FEWEST = 10
"""Fewest pictures of a film."""

_JERKS = 3
"""Order of the differences that the noise is measured by: what is left of a motion are the robot's jerks."""

_LEAST_PX = 0.02
"""Error of a point that is never undercut, pixels."""


@dataclass(frozen=True)
class Length:
    """A known length, beside the robot's path and as far from the camera as the point.

    Attributes:
        begin, end: its ends in the first picture, in the direction of travel, pixels.
        mm: the length, mm.
    """

    begin: tuple[float, float]
    end: tuple[float, float]
    mm: float

    @property
    def m_per_px(self) -> float:
        """Metres a pixel."""
        return 1e-3 * self.mm / float(np.linalg.norm(np.subtract(self.end, self.begin)))

    def axes(self, view: str) -> Array:
        """Return forward, and up (from the side) or left (from above), in pixels, y down, shape (2, 2)."""
        forward = np.subtract(self.end, self.begin) / np.linalg.norm(np.subtract(self.end, self.begin))
        left = np.array([forward[1], -forward[0]])
        upward = left if view == "top" or left[1] < 0.0 else -left
        return np.stack([forward, upward])


@dataclass(frozen=True)
class PointTracker:
    """What is followed in films without tags.

    Attributes:
        point: a coloured dot or a patch of the first picture.
        length: a known length.
        view: ``side`` or ``top``: from where the camera looks.
    """

    point: Dot | Patch
    length: Length
    view: str = "side"


@dataclass(frozen=True)
class PointTrack:
    """What was found in a film without tags.

    Attributes:
        film: the film.
        time: time stamp of each picture from the first one, s, shape (n,).
        signals: the marker's coordinates, m, each of shape (n,), NaN in gaps.
        noise: standard deviation of each signal's noise, m.
        places: the point in each picture, pixels, shape (n, 2), NaN in gaps.
        m_per_px: metres a pixel.
        sync: when the gait began.
        defects: what is wrong with the film.
    """

    film: Path
    time: Array
    signals: Mapping[str, Array]
    noise: Mapping[str, float]
    places: Array
    m_per_px: float
    sync: Sync = UNKNOWN
    defects: tuple[Defect, ...] = ()

    @property
    def fps(self) -> float:
        """Frame rate, the median, frames a second."""
        return float(1.0 / np.median(np.diff(self.time)))

    @property
    def seen(self) -> float:
        """Share of the pictures in which the point was seen."""
        return float(np.isfinite(self.places[:, 0]).mean())

    def sentence(self) -> str:
        """Return what was found, in a line."""
        return (
            f"{self.film}: {len(self.time)} frames in {self.time[-1]:.2f} s, one point without tags, seen in "
            f"{self.seen:.0%} of them, {figure(1e3 * self.m_per_px)} mm a pixel"
        )

    def lines(self) -> list[str]:
        """Return the noise of each signal, in lines."""
        noise = [f"{name}: noise {figure(1e3 * self.noise[name])} mm" for name in self.signals]
        return [*noise, self.sync.sentence()]

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt track --json` prints of a film."""
        return {
            "film": str(self.film),
            "frames": len(self.time),
            "seconds": float(self.time[-1]),
            "fps": self.fps,
            "m_per_px": self.m_per_px,
            "sync": self.sync.to_dict(),
            "signals": [
                {"signal": name, "seen": self.seen, "noise_m": self.noise[name]} for name in self.signals
            ],
        }


def track_point(
    film: Path, tracker: PointTracker, progress: OnProgress = silent, beginning: Beginning | None = None
) -> PointTrack:
    """Return the path of a point in a film; the camera stands still.

    Args:
        film: the film.
        tracker: the point, and a known length.
        progress: called after some pictures.
        beginning: what shows that the gait begins, if it is known.

    Raises:
        GaitoptError: it is no film, ends in the middle, or there is no such point in its first picture.
    """
    colour = isinstance(tracker.point, Dot)
    total = facts_of(film).frames
    lamp = Lamp(beginning, ()) if isinstance(beginning, LampMark) else None
    times: list[float] = []
    places: list[Array] = []
    follower: DotFollower | PatchFollower | None = None
    for at, picture in pictures(film, colour):
        if follower is None:
            follower = _follower(film, tracker.point, picture)
        place = follower.look(picture)
        times.append(at)
        places.append(np.full(2, np.nan) if place is None else place)
        if lamp is not None:
            lamp.look(np.asarray(picture.max(axis=2)) if colour else picture, {})
        progress(Progress(film.name, len(times), max(total, len(times)) or None, "frames"))
    if len(times) < _FEWEST:
        raise GaitoptError(f"{film}: found {len(times)} pictures; allowed: {_FEWEST} or more")
    time, path = np.array(times), np.array(places)
    sure = np.flatnonzero(np.isfinite(path).all(axis=1))
    if not len(sure):
        raise GaitoptError(f"{film}: the point is in no picture; allowed: one that the film shows")
    sync = UNKNOWN
    if isinstance(beginning, (TimeMark, FrameMark)):
        sync = beginning.sync(time)
    elif lamp is not None:
        sync = lamp.sync(time)
    lost = beginning is not None and sync.at_s is None
    defects = (Defect("sync_not_found", film.stem, sync.how, 0),) if lost else ()
    scale = tracker.length.m_per_px
    moved = scale * (path - path[sure[0]]) @ tracker.length.axes(tracker.view).T
    signals = dict(zip(VIEWS[tracker.view], moved.T, strict=True))
    noise = {name: max(noise_sd(series, _JERKS), scale * _LEAST_PX) for name, series in signals.items()}
    return PointTrack(film, time, signals, noise, path, scale, sync, defects)


def _follower(film: Path, point: Dot | Patch, picture: NDArray[np.uint8]) -> DotFollower | PatchFollower:
    try:
        return DotFollower(point, picture) if isinstance(point, Dot) else PatchFollower(point, picture)
    except GaitoptError as error:
        raise GaitoptError(f"{film}: {error}") from None
