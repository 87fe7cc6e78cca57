"""Following a point without tags: a coloured dot, or a patch. What is not sure is a gap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.track.opencv import opencv

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

_LEAST_CHROMA = 15.0
"""Least distance of a dot's colour from grey, in CIELAB."""

_LEAST_AREA, _MOST_AREA = 12.0, 0.02
"""Least area of a dot, pixels, and the most, as a share of the picture."""

_AREAS = (0.7, 1.4)
"""How much smaller and larger than usual a dot may look: if it is smaller, something hides part of it."""

_LEAST_PATCH, _LEAST_CONTRAST = 12.0, 8.0
"""Least edge of a patch, pixels, and least standard deviation of its brightness, of 255."""

_ALIKE, _TWIN = 0.8, 0.95
"""Least correlation of a patch, and how alike, relative, no second place may be."""

_SEARCH_EVERY = 5
"""Pictures between searches of the whole picture for a patch that is lost."""


@dataclass(frozen=True)
class Dot:
    """A coloured dot that covers a pixel of the first picture."""

    x: float
    y: float


@dataclass(frozen=True)
class Patch:
    """A patch of the first picture: upper left corner, width and height, pixels."""

    x: float
    y: float
    width: float
    height: float


class _Guess:
    """Where a point will be: it moves on as it did."""

    def __init__(self, place: Array):
        self.last: Array | None = place
        self.motion = np.zeros(2)

    def take(self, place: Array | None) -> Array | None:
        """Take the place in the next picture, and return it."""
        known = self.last is not None and place is not None
        self.motion = place - self.last if known else np.zeros(2)  # type: ignore[operator]
        self.last = place
        return place


class DotFollower:
    """Follows a coloured dot.

    Args:
        dot: where it is in the first picture.
        picture: the first picture, in colour.

    Raises:
        GaitoptError: there is no dot.
    """

    colour = True

    def __init__(self, dot: Dot, picture: Pixels):
        place = np.array([dot.x, dot.y])
        _check_inside("--dot", place, picture)
        x, y = place.round().astype(int)
        own = _lab(picture[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]).reshape(-1, 3)
        self._colour = np.median(own[:, 1:], axis=0)
        self._chroma = float(np.linalg.norm(self._colour))
        if self._chroma < _LEAST_CHROMA:
            raise GaitoptError(f"--dot: found grey at {x},{y}; allowed: a coloured dot, or --patch")
        labels, areas, _ = self._parts(picture)
        self._area = float(areas[labels[y, x]]) if labels[y, x] else 0.0
        most = _MOST_AREA * labels.size
        if not _LEAST_AREA <= self._area <= most:
            allowed = f"a dot of {_LEAST_AREA:.0f} to {most:.0f} pixels on another colour, or --patch"
            raise GaitoptError(
                f"--dot: found {self._area:.0f} pixels of one colour at {x},{y}; allowed: {allowed}"
            )
        self._guess = _Guess(place)

    def look(self, picture: Pixels) -> Array | None:
        """Return the dot's middle in the next picture, pixels, shape (2,); None where that is not sure."""
        low = np.zeros(2, int)
        if self._guess.last is not None:
            middle = self._guess.last + self._guess.motion
            reach = 3.0 * math.sqrt(self._area) + 2.0 * float(np.linalg.norm(self._guess.motion)) + 8.0
            low = np.maximum(np.floor(middle - reach).astype(int), 0)
            high = np.ceil(middle + reach).astype(int) + 1
            picture = picture[low[1] : max(high[1], 0), low[0] : max(high[0], 0)]
        if min(picture.shape[:2]) < 3:
            return self._guess.take(None)
        labels, areas, weights = self._parts(picture)
        small, large = (share * self._area for share in _AREAS)
        alike = [i for i in range(1, len(areas)) if areas[i] > 0.3 * self._area]
        if len(alike) != 1 or not small <= areas[alike[0]] <= large:
            return self._guess.take(None)  # none, several, or one that is partly hidden
        rows, columns = np.nonzero(opencv().dilate((labels == alike[0]).astype(np.uint8), np.ones((3, 3))))
        if min(rows.min(), columns.min()) == 0 or (rows.max() + 1, columns.max() + 1) >= labels.shape:
            return self._guess.take(None)  # it reaches beyond the picture
        weight = weights[rows, columns]
        self._area += 0.05 * (float(areas[alike[0]]) - self._area)
        place = np.array([weight @ columns, weight @ rows]) / weight.sum()
        return self._guess.take(place + low)

    def _parts(self, picture: Pixels) -> tuple[NDArray[np.int32], Array, Array]:
        """Return the parts of the dot's colour: labels, areas by label, and how much of it a pixel has."""
        away = np.linalg.norm(_lab(picture)[..., 1:] - self._colour, axis=-1)
        weights = np.clip(1.0 - away / self._chroma, 0.0, 1.0)
        count, labels, figures, _ = opencv().connectedComponentsWithStats((weights > 0.5).astype(np.uint8))
        areas = np.array([0.0, *figures[1:count, opencv().CC_STAT_AREA]])
        return labels, areas, weights


class PatchFollower:
    """Follows a patch: it may shift and turn in the picture. It is always compared with the first picture.

    Args:
        patch: where it is in the first picture.
        picture: the first picture, grey.

    Raises:
        GaitoptError: it is too small, plain, or not in the picture.
    """

    colour = False

    def __init__(self, patch: Patch, picture: Pixels):
        low = np.round([patch.x, patch.y]).astype(int)
        size = np.round([patch.width, patch.height]).astype(int)
        if not (size >= _LEAST_PATCH).all():
            raise GaitoptError(
                f"--patch: found {size[0]} by {size[1]} pixels; allowed: {_LEAST_PATCH:.0f} or more"
            )
        for corner in (low, low + size - 1):
            _check_inside("--patch", corner, picture)
        self._patch = picture[low[1] : low[1] + size[1], low[0] : low[0] + size[0]].astype(np.float32)
        contrast = float(self._patch.std())
        if contrast < _LEAST_CONTRAST:
            raise GaitoptError(
                f"--patch: found plain, contrast {contrast:.0f}; allowed: {_LEAST_CONTRAST:.0f} of 255"
            )
        self._middle = 0.5 * (size - 1.0)
        self._angle = 0.0
        self._guess = _Guess(low + self._middle)
        self._frame = 0

    def look(self, picture: Pixels) -> Array | None:
        """Return the patch's middle in the next picture, pixels, shape (2,); None where that is not sure."""
        self._frame += 1
        if self._guess.last is not None:
            reach = 0.75 * float(self._middle.max()) + 2.0 * float(np.linalg.norm(self._guess.motion)) + 8.0
            about = self._guess.last + self._guess.motion
            low = np.maximum(np.floor(about - self._middle - reach).astype(int), 0)
            high = np.ceil(about + self._middle + reach).astype(int) + 1
        elif self._frame % _SEARCH_EVERY == 0:
            self._angle, low, high = 0.0, np.zeros(2, int), np.array(picture.shape[::-1])
        else:
            return None
        part = picture[low[1] : max(high[1], 0), low[0] : max(high[0], 0)].astype(np.float32)
        if part.shape[0] < self._patch.shape[0] + 2 or part.shape[1] < self._patch.shape[1] + 2:
            return self._guess.take(None)
        begin = self._matched(part)
        found = None if begin is None else self._laid(part, begin)
        return self._guess.take(None if found is None else found + low)

    def _matched(self, part: NDArray[np.float32]) -> Array | None:
        """Return where the patch's middle is to a pixel; None where two places look alike."""
        cv2 = opencv()
        turned = cv2.warpAffine(
            self._patch,
            _turn(self._angle, self._middle),
            self._patch.shape[::-1],
            borderMode=cv2.BORDER_REPLICATE,
        )
        alike = cv2.matchTemplate(part, turned, cv2.TM_CCOEFF_NORMED)
        _, best, _, (x, y) = cv2.minMaxLoc(alike)
        if not best >= 0.7 * _ALIKE:
            return None
        half = np.maximum(self._middle, 4.0).astype(int)
        alike[max(y - half[1], 0) : y + half[1] + 1, max(x - half[0], 0) : x + half[0] + 1] = -1.0
        return None if alike.max() > _TWIN * best else np.array([x, y]) + self._middle

    def _laid(self, part: NDArray[np.float32], middle: Array) -> Array | None:
        """Return where the patch's middle is after the patch was laid on the picture."""
        cv2 = opencv()
        c, s = math.cos(self._angle), math.sin(self._angle)
        turn = np.array([[c, -s], [s, c]])
        warp = np.column_stack([turn, middle - turn @ self._middle]).astype(np.float32)
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-5)
        try:
            alike, warp = cv2.findTransformECC(self._patch, part, warp, cv2.MOTION_EUCLIDEAN, stop, None, 3)
        except cv2.error:  # the rounds led away from the picture
            return None
        place = warp[:, :2].astype(float) @ self._middle + warp[:, 2]
        if not alike >= _ALIKE or not np.linalg.norm(place - middle) < max(4.0, 0.3 * self._middle.min()):
            return None
        self._angle = math.atan2(float(warp[1, 0]), float(warp[0, 0]))
        return np.asarray(place, dtype=float)


def _turn(angle: float, middle: Array) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    return np.column_stack([turn, middle - turn @ middle])


def _lab(picture: Pixels) -> NDArray[np.float32]:
    cv2 = opencv()
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(picture, np.float32) / 255.0, cv2.COLOR_RGB2LAB))


def _check_inside(option: str, place: Array, picture: Pixels) -> None:
    high, wide = picture.shape[:2]
    if not (0.0 <= place[0] < wide and 0.0 <= place[1] < high):
        raise GaitoptError(
            f"{option}: found {place[0]:g},{place[1]:g}; allowed: inside {wide} by {high} pixels"
        )
