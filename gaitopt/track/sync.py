"""When the gait began in a film: a lamp lights up, a tag begins to move, or somebody said it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import robust_sd, uniform_sd
from gaitopt.track.film import Picture
from gaitopt.track.opencv import opencv
from gaitopt.track.pose import Pose
from gaitopt.track.room import Room, Seen, rays_on_floor
from gaitopt.track.settings import DEFAULT, TrackSettings

Array = NDArray[np.float64]

_FEWEST = 5
"""Pictures of a dark lamp, or of a tag at rest, that are needed before it counts as such."""

_STAYS = 3
"""Pictures for which a lamp is lit, or a tag is away, before that counts."""

_RISE, _NOISES = 25.0, 6.0
"""Least rise of a lamp's brightness, of 255, and least change in standard deviations of what was before."""

_REST = 50.0
"""A tag at rest moves by less, in least errors of a corner."""

_LAMP = 1.0 / 240.0
"""Radius of the spot in which a lamp is looked for, over the picture's width: 8 pixels of 1920."""


@dataclass(frozen=True)
class Sync:
    """When a gait began.

    Attributes:
        at_s: time stamp, s; None where it is not known.
        sd_s: its standard deviation, s.
        how: where this comes from, in words.
    """

    at_s: float | None
    sd_s: float
    how: str

    def sentence(self) -> str:
        """Return it in a line."""
        if self.at_s is None:
            return f"the gait's beginning is not known: {self.how}"
        return f"the gait began at {self.at_s:.3f} s (± {1e3 * self.sd_s:.0f} ms): {self.how}"

    def to_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return asdict(self)


UNKNOWN = Sync(None, 0.0, "nothing was said of it")


@dataclass(frozen=True)
class TimeMark:
    """It was said at which time stamp, s, the gait began."""

    at_s: float

    def sync(self, time: Array) -> Sync:
        """Return when the gait began."""
        return Sync(self.at_s, 0.0, "as was said")


@dataclass(frozen=True)
class FrameMark:
    """It was said in which picture the gait begins; the first one is 0."""

    frame: int

    def sync(self, time: Array) -> Sync:
        """Return when the gait began; `time` holds the time stamps of all pictures, s, shape (n,)."""
        if not 0 <= self.frame < len(time):
            return Sync(None, 0.0, f"picture {self.frame} was said; the film has 0 to {len(time) - 1}")
        return Sync(float(time[self.frame]), _uncertain(time), f"picture {self.frame}, as was said")


@dataclass(frozen=True)
class LampMark:
    """A lamp lights up when the gait begins: the LED of the exported player.

    Attributes:
        x, y: where it is in the first picture, pixels from the upper left corner. It rests until it lights
            up.
    """

    x: float
    y: float


@dataclass(frozen=True)
class TagMark:
    """A tag that rested moves when the gait begins: one of the robot, or one on what starts it."""

    tag: int


Beginning = TimeMark | FrameMark | LampMark | TagMark
"""What shows, or says, when a gait begins."""


class Lamp:
    """Watches the brightness of a lamp through a film. Where the camera moves, it follows the floor's tags.

    Args:
        mark: where the lamp is.
        floor: the tags of the floor.
    """

    def __init__(self, mark: LampMark, floor: Iterable[int]):
        self._mark, self._floor = mark, frozenset(floor)
        self._first: Seen | None = None
        self._levels: list[float] = []

    def look(self, picture: Picture, seen: Seen) -> None:
        """Take the next picture, and the corners of the tags in it."""
        self._first = seen if self._first is None else self._first
        self._levels.append(self._level(picture, seen))

    def sync(self, time: Array) -> Sync:
        """Return when the lamp lit up; `time` holds the time stamps of all pictures, s, shape (n,)."""
        return lit(time, np.array(self._levels), f"the lamp at {self._mark.x:g},{self._mark.y:g}")

    def _level(self, picture: Picture, seen: Seen) -> float:
        """Return how bright the lamp is, of 255; NaN where it is not in the picture."""
        place = self._place(seen)
        radius = max(2.0, _LAMP * max(picture.shape))
        low, high = np.floor(place - radius).astype(int), np.ceil(place + radius).astype(int) + 1
        if not np.isfinite(place).all() or (low < 0).any() or (high > picture.shape[::-1]).any():
            return math.nan
        return float(np.percentile(picture[low[1] : high[1], low[0] : high[0]], 90.0))

    def _place(self, seen: Seen) -> Array:
        """Return where the lamp is in a picture, pixels, shape (2,)."""
        place = np.array([self._mark.x, self._mark.y])
        first = self._first or {}
        both = [n for n in self._floor if n in seen and n in first]
        if not both:
            return place
        before, now = (np.concatenate([corners[n] for n in both]) for corners in (first, seen))
        if np.abs(now - before).max() < 1.0:
            return place
        moved, _ = opencv().findHomography(before, now)
        if moved is None:
            return np.full(2, np.nan)
        ahead = moved @ np.array([*place, 1.0])
        return np.asarray(ahead[:2] / ahead[2])


def lit(time: Array, levels: Array, what: str) -> Sync:
    """Return when a lamp lit up.

    A picture in which it has part of its later brightness was exposed while it lit up. Otherwise that was
    between two pictures.

    Args:
        time: time stamps, s, shape (n,).
        levels: its brightness, of 255, shape (n,); NaN where it is not seen.
        what: the lamp, in words.
    """
    for index in range(_FEWEST, len(levels) - _STAYS + 1):
        dark, after = levels[:index], levels[index : index + _STAYS]
        if np.isfinite(dark).sum() < _FEWEST:
            continue
        usual = float(np.nanmedian(dark))
        noise = robust_sd(dark - usual)
        if not (after > usual + max(_RISE, _NOISES * noise)).all() or not np.isfinite(levels[index - 1]):
            continue
        if (dark[np.isfinite(dark)] > usual + _RISE).any():
            break  # it was lit before
        share = (levels[index] - usual) / (float(np.median(after[1:])) - usual)
        if share < 0.8:
            return Sync(float(time[index]), 0.2 * _uncertain(time), f"{what} lit up")
        at = 0.5 * (time[index - 1] + time[index])
        return Sync(float(at), _uncertain(time), f"{what} lit up")
    return Sync(None, 0.0, f"{what} does not light up after {_FEWEST} pictures of darkness or more")


def first_motion(
    tag: int,
    time: Array,
    frames: Sequence[Seen],
    cameras: Sequence[Pose | None],
    room: Room,
    settings: TrackSettings = DEFAULT,
) -> Sync:
    """Return when a tag that rested began to move.

    Args:
        tag: its number.
        time: time stamps, s, shape (n,).
        frames: the corners in each picture.
        cameras: the floor's pose in the frame of the camera of each.
        room: lens and floor.
        settings: how well a corner is known.
    """
    places = np.full((len(frames), 2), np.nan)
    for index, (seen, camera) in enumerate(zip(frames, cameras, strict=True)):
        if tag in seen and camera is not None:
            middle = seen[tag].mean(axis=0)[None]
            places[index] = rays_on_floor(room.lens.directions(middle), camera)[0, :2]
    here = np.flatnonzero(np.isfinite(places[:, 0]))
    far = next((float(np.linalg.norm(c.shift)) for c in cameras if c is not None), 1.0)
    least = settings.least_px / room.lens.focal * far
    for count in range(_FEWEST, len(here) - _STAYS + 1):
        rest, after = places[here[:count]], places[here[count : count + _STAYS]]
        middle = np.median(rest, axis=0)
        noise = max(*map(robust_sd, (rest - middle).T), least)
        if noise > _REST * least:
            break
        if (np.linalg.norm(after - middle, axis=1) > _NOISES * noise).all():
            last, first = time[here[count - 1]], time[here[count]]
            at, sd = 0.5 * (last + first), 0.5 * (first - last) / math.sqrt(3.0)
            return Sync(float(at), float(sd), f"tag {tag} began to move")
    return Sync(None, 0.0, f"tag {tag} does not rest for {_FEWEST} pictures and move then")


def _uncertain(time: Array) -> float:
    """Return the standard deviation of a moment that lies anywhere between two pictures, s."""
    return uniform_sd(float(np.median(np.diff(time))))
