"""A film: its pictures with its own time stamps, upright."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import kind_of

Picture = NDArray[np.uint8]
"""Grey values, shape (height, width)."""

_FORMATS = "mov,mp4,matroska,webm,avi,mpeg,mpegts,ogg,flv,asf"
"""Containers that are read. None of them makes FFmpeg open another file."""

_SHORT_S = 0.3
"""A film may end this much earlier than it says, s: the sound may be longer than the pictures."""


@dataclass(frozen=True)
class FilmFacts:
    """What a film says of itself.

    Attributes:
        path: the file.
        seconds: its length, s; 0 where it does not say.
        frames: about how many pictures it has; 0 where that is not known.
        quarters: how often its pictures are turned by 90 degrees to the left, to stand upright.
    """

    path: Path
    seconds: float
    frames: int
    quarters: int = 0


def facts_of(path: Path) -> FilmFacts:
    """Return what a film says of itself.

    Raises:
        GaitoptError: it is no film, or none that can be read.
    """
    import av

    with _opened(path) as (container, stream):
        seconds = _length(container, stream)
        rate = float(stream.average_rate or 0.0)
        try:
            first = next(container.decode(stream), None)
        except av.error.FFmpegError:
            first = None  # `pictures` says what is wrong with it
        return FilmFacts(path, seconds, int(stream.frames or round(seconds * rate)), _quarters(first))


def pictures(path: Path, colour: bool = False) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Yield the time of each picture from the first one, s, and the picture.

    Args:
        path: the film.
        colour: whether pictures are in colour, shape (height, width, 3), or grey, shape (height, width).

    Raises:
        GaitoptError: it is no film, or it ends earlier than it says.
    """
    import av

    with _opened(path) as (container, stream):
        stream.thread_type = "NONE"  # a picture at a time: memory for one
        first, at = None, 0.0
        length = _length(container, stream)
        try:
            for frame in container.decode(stream):
                if frame.time is None:
                    raise GaitoptError(
                        f"{path}: its pictures have no time stamps; allowed: a film as it was made"
                    )
                first = float(frame.time) if first is None else first
                at = float(frame.time) - first
                yield at, _upright(frame, colour)
        except av.error.FFmpegError:
            raise _cut_off(path, at, length) from None
        if first is None:
            raise GaitoptError(f"{path}: holds no picture; allowed: a film")
        rate = float(stream.average_rate or 30.0)
        if length - at > _SHORT_S + 2.0 / rate:
            raise _cut_off(path, at, length)


def _cut_off(path: Path, at: float, length: float) -> GaitoptError:
    of = f" of {length:.2f} s" if length else ""
    return GaitoptError(f"{path}: the film ends in the middle, after {at:.2f} s{of}; copy it again")


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a film, and yield it with its stream of pictures."""
    import av

    try:
        kind = kind_of(path.stat())
    except OSError as error:
        raise GaitoptError(f"{path}: cannot be read: {error.strerror}") from None
    if kind is not None:
        raise GaitoptError(f"{path}: found {kind}; allowed: a film")
    try:
        container = av.open(f"file:{path}", options={"format_whitelist": _FORMATS})
    except av.error.FFmpegError:
        raise GaitoptError(f"{path}: not a film that can be read, or one whose copying was cut off") from None
    with container:
        if not container.streams.video:
            raise GaitoptError(f"{path}: holds no pictures; allowed: a film")
        yield container, container.streams.video[0]


def _length(container: Any, stream: Any) -> float:
    """Return the length of the pictures that a film says, s; 0 where it does not."""
    if stream.duration and stream.time_base:
        return float(stream.duration * stream.time_base)
    return 0.0


def _upright(frame: Any, colour: bool) -> NDArray[np.uint8]:
    """Return a frame as it is shown: turned as its rotation flag says."""
    array = frame.to_ndarray(format="rgb24" if colour else "gray")
    return np.ascontiguousarray(np.rot90(array, _quarters(frame)))


def _quarters(frame: Any) -> int:
    return round(float(getattr(frame, "rotation", 0) or 0) / 90.0) % 4
