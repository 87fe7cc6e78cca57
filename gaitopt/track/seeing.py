"""Seeing: which tags are in a picture, and where their corners are, to a few hundredths of a pixel."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gaitopt.track.film import Picture
from gaitopt.track.opencv import opencv
from gaitopt.track.settings import DEFAULT, TrackSettings
from gaitopt.track.tag import CELLS, pattern

Array = NDArray[np.float64]

_ROUNDS, _GAIN = 20, 1e-4
"""Most rounds in which a pattern is laid on a picture, and the gain in correlation after which that ends."""


_FINEST = 10
"""Most pixels along a cell of a pattern: more take time and say no more."""


class Eye:
    """Follows tags through a film: each is laid on the picture where it was before, and searched when lost.

    While the tags of the floor rest, one of them is looked at in each picture, in turn; the others count as
    where they were. As soon as it has moved, all are looked at.

    Args:
        numbers: the tags that are looked for.
        floor: those of them that lie on the floor.
        settings: how they are judged.
    """

    def __init__(self, numbers: Iterable[int], floor: Iterable[int] = (), settings: TrackSettings = DEFAULT):
        aruco = opencv().aruco
        family = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11)
        parameters = aruco.DetectorParameters()
        parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
        parameters.minMarkerPerimeterRate = 0.01
        self._detector = aruco.ArucoDetector(family, parameters)
        self._numbers, self._floor, self._settings = frozenset(numbers), frozenset(floor), settings
        self._resting: set[int] = set()
        self._last: dict[int, tuple[Array, Array]] = {}
        self._frame = 0
        self.strangers: set[int] = set()

    def look(self, picture: Picture) -> dict[int, Array]:
        """Return the corners of the tags in the next picture, by number, pixels, shape (4, 2)."""
        found = self._rested(picture)
        for number, (corners, motion) in self._last.items():
            laid = None if number in found else aligned(picture, number, corners + motion, self._settings)
            if laid is not None:
                found[number] = laid
        lost = any(number not in found for number in self._last)
        due = len(found) < len(self._numbers) and self._frame % self._settings.search_every == 0
        if lost or due or not self._last:
            for number, corners in self._searched(picture):
                if number not in found:
                    laid = aligned(picture, number, corners, self._settings)
                    if laid is not None:
                        found[number] = laid
        before = {number: corners for number, (corners, _) in self._last.items()}
        here = [n for n in found if n in self._floor]
        moved = [_moved(found[n], before[n]) if n in before else np.inf for n in here]
        self._resting = set(here) if here and max(moved) < self._settings.rest_px else set()
        self._last = {n: (c, c - before[n] if n in before else np.zeros((4, 2))) for n, c in found.items()}
        self._frame += 1
        return found

    def _rested(self, picture: Picture) -> dict[int, Array]:
        """Return the corners of the floor's tags if they rest, by one of them; else nothing."""
        resting = sorted(self._resting)
        if not resting:
            return {}
        looked = resting[self._frame % len(resting)]
        corners = self._last[looked][0]
        laid = aligned(picture, looked, corners, self._settings)
        if laid is None or _moved(laid, corners) > self._settings.rest_px:
            return {}
        return {number: self._last[number][0] for number in resting} | {looked: laid}

    def _searched(self, picture: Picture) -> list[tuple[int, Array]]:
        """Return the tags that a search of the whole picture finds; none that is seen twice."""
        corners, numbers, _ = self._detector.detectMarkers(picture)
        if numbers is None or len(corners) == 0:
            return []
        names = np.ravel(numbers).tolist()
        self.strangers |= set(names) - self._numbers
        quads = np.reshape(np.array(corners, dtype=float), (-1, 4, 2))
        wanted = [n for n in names if n in self._numbers and names.count(n) == 1]
        return [(n, quad) for n, quad in zip(names, quads, strict=True) if n in wanted]


def aligned(picture: Picture, number: int, corners: Array, settings: TrackSettings = DEFAULT) -> Array | None:
    """Return a tag's corners after its whole pattern was laid on a picture; None where it is not there.

    Args:
        picture: the picture.
        number: the tag.
        corners: about where its corners are, from the top left, clockwise, pixels, shape (4, 2).
        settings: how alike the picture has to be.
    """
    cv2 = opencv()
    edge = edge_of(corners)
    if not settings.smallest_px <= edge <= max(picture.shape):
        return None
    room = int(0.3 * edge) + 4
    low = np.floor(corners.min(axis=0)).astype(int) - room
    high = np.ceil(corners.max(axis=0)).astype(int) + room
    low, high = np.maximum(low, 0), np.minimum(high, picture.shape[::-1])
    if (high - low < 8).any():
        return None
    part = picture[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    scale = min(max(4, 2 * int(np.ceil(edge / CELLS / 2.0))), _FINEST)
    blur = round(settings.blur_px * CELLS * scale / edge, 1)
    ends = scale / 2.0 - 0.5 + np.array([0.0, CELLS * scale])
    square = np.array([[ends[0], ends[0]], [ends[1], ends[0]], [ends[1], ends[1]], [ends[0], ends[1]]])
    warp = cv2.getPerspectiveTransform(square.astype(np.float32), (corners - low).astype(np.float32))
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, _ROUNDS, _GAIN)
    try:
        alike, warp = cv2.findTransformECC(
            _template(number, scale, blur),
            part,
            warp.astype(np.float32),
            cv2.MOTION_HOMOGRAPHY,
            stop,
            None,
            1,
        )
    except cv2.error:  # the rounds led away from the picture
        return None
    if not alike >= settings.alike or not np.isfinite(warp).all():
        return None
    laid = np.asarray(cv2.perspectiveTransform(square[None], warp.astype(float))[0] + low, dtype=float)
    inside = (laid >= 0.0).all() and (laid <= np.array(picture.shape[::-1]) - 1.0).all()
    moved = float(np.abs(laid - corners).max())
    return laid if inside and moved < 0.5 * edge and 0.7 < edge_of(laid) / edge < 1.4 else None


def _moved(one: Array, other: Array) -> float:
    return float(np.abs(one - other).max())


def edge_of(corners: Array) -> float:
    """Return the mean edge of a tag in a picture, pixels."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean())


@cache
def _template(number: int, scale: int, blur: float) -> NDArray[np.float32]:
    """Return a tag with half a cell of its margin, blurred.

    Args:
        number: the tag.
        scale: pixels along a cell, an even number.
        blur: standard deviation of the blur, pixels of this picture.
    """
    cells = np.pad(np.where(pattern(number), 0.0, 1.0), 2, constant_values=1.0)
    whole = np.kron(cells, np.ones((scale, scale))).astype(np.float32)
    cut = scale * 3 // 2
    blurred = opencv().GaussianBlur(whole, (0, 0), blur)
    return np.ascontiguousarray(blurred[cut:-cut, cut:-cut])
