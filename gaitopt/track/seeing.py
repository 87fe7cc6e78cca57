"""Seeing: which tags are in a picture, and where their corners are, to a few hundredths of a pixel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
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


_BLURS_PX = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0, 2.5)
"""Blurs of a film that are tried, pixels."""

_RAREST, _AROUND = 40, 1.0
"""Most pictures between searches for what is not there, and room around a tag that is lost, in its edges."""

_FINEST = 10
"""Most pixels along a cell of a pattern: more take time and say no more."""


class Eye:
    """Follows tags through a film: each is laid on the picture where it was before, and searched when lost.

    While the tags of the floor rest, one of them is looked at in each picture, in turn; the others count as
    where they were. As soon as it has moved, all are looked at. A hand that moves the floor's tags in the
    picture moves all. What is lost is searched around its last place, then everywhere; what is not there is
    searched ever less often.

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
        self._frame = self._next = 0
        self._pause = settings.search_every
        self._focused = False
        self.strangers: set[int] = set()

    def look(self, picture: Picture) -> dict[int, Array]:
        """Return the corners of the tags in the next picture, by number, pixels, shape (4, 2)."""
        found = self._rested(picture)
        self._follow(picture, found)
        lost = any(number not in found for number in self._last)
        if lost or not self._last:
            self._pause, self._next = self._settings.search_every, self._frame
        if len(found) < len(self._numbers) and self._frame >= self._next:
            seen = self._searched(picture)
            self._focus(picture, seen)
            more = self._laid(picture, seen, found)
            self._pause = self._settings.search_every if more else min(2 * self._pause, _RAREST)
            self._next = self._frame + self._pause
            found |= more
        before = {number: corners for number, (corners, _) in self._last.items()}
        here = [n for n in found if n in self._floor]
        moved = [_moved(found[n], before[n]) if n in before else np.inf for n in here]
        self._resting = set(here) if here and max(moved) < self._settings.rest_px else set()
        self._last = {n: (c, c - before[n] if n in before else np.zeros((4, 2))) for n, c in found.items()}
        self._frame += 1
        return found

    def _focus(self, picture: Picture, seen: Sequence[tuple[int, Array]]) -> None:
        """Measure how blurred the film is, by the first tags that are seen.

        A pattern that is sharper than the picture, or less sharp, looks larger or smaller than it is.
        """
        if self._focused or not seen:
            return
        self._focused = True

        def alike(blur: float) -> float:
            settings = replace(self._settings, blur_px=blur)
            return sum(laid[1] for n, corners in seen if (laid := _laid_on(picture, n, corners, settings)))

        self._settings = replace(self._settings, blur_px=max(_BLURS_PX, key=alike))

    def _follow(self, picture: Picture, found: dict[int, Array]) -> None:
        """Add the tags that were seen before and are near where they should be; the floor's come first."""
        guesses = {n: corners + motion for n, (corners, motion) in self._last.items()}
        for number in sorted(guesses, key=lambda n: (n not in self._floor, n)):
            if number in found:
                continue
            by_hand = [(found[n] - guesses[n]).mean(axis=0) for n in found if n in self._floor]
            guess = guesses[number] + np.mean(by_hand, axis=0) if by_hand else guesses[number]
            laid = aligned(picture, number, guess, self._settings)
            if laid is None:
                laid = self._laid(picture, self._searched(picture, guess), {}).get(number)
            if laid is not None:
                found[number] = laid

    def _laid(
        self, picture: Picture, seen: Iterable[tuple[int, Array]], known: Mapping[int, Array]
    ) -> dict[int, Array]:
        """Return those of some tags, searched and found, that are there and were not known."""
        pairs = ((n, aligned(picture, n, corners, self._settings)) for n, corners in seen if n not in known)
        return {n: corners for n, corners in pairs if corners is not None}

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

    def _searched(self, picture: Picture, near: Array | None = None) -> list[tuple[int, Array]]:
        """Return the tags that a search of the picture finds, or around corners; none that is seen twice."""
        low = np.zeros(2, dtype=int)
        if near is not None:
            room = _AROUND * edge_of(near)
            low = np.maximum(np.floor(near.min(axis=0) - room).astype(int), 0)
            high = np.maximum(np.ceil(near.max(axis=0) + room).astype(int), 0)
            picture = np.ascontiguousarray(picture[low[1] : high[1], low[0] : high[0]])
            if min(picture.shape) < 8:
                return []
        corners, numbers, _ = self._detector.detectMarkers(picture)
        if numbers is None or len(corners) == 0:
            return []
        names = np.ravel(numbers).tolist()
        self.strangers |= set(names) - self._numbers
        quads = np.reshape(np.array(corners, dtype=float), (-1, 4, 2)) + low
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
    laid = _laid_on(picture, number, corners, settings)
    return None if laid is None else laid[0]


def _laid_on(
    picture: Picture, number: int, corners: Array, settings: TrackSettings
) -> tuple[Array, float] | None:
    """Return a tag's corners as `aligned` does, and how alike pattern and picture are there."""
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
    fits = inside and moved < 0.5 * edge and 0.7 < edge_of(laid) / edge < 1.4
    return (laid, float(alike)) if fits else None


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
