"""The room: the lens, the tags of the floor and the camera, solved from the pictures of a film."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from gaitopt.core.errors import GaitoptError
from gaitopt.track.lens import Lens
from gaitopt.track.pose import Pose, fitted, poses_of
from gaitopt.track.settings import DEFAULT, TrackSettings
from gaitopt.track.tag import corners as tag_corners

Array = NDArray[np.float64]

Seen = Mapping[int, Array]
"""Corners of the tags in a picture by number, pixels, shape (4, 2)."""

_QUOTIENT = 1e-7
"""Step of a difference quotient, rad, m or a share of what is expected of a lens."""

_CORNER_PX = 0.1
"""Error of a corner against which the expected lens is weighed, pixels."""


@dataclass(frozen=True)
class FloorTag:
    """A tag that lies on the floor.

    Attributes:
        size: edge of its black square, m.
        place: its middle along forward and left, m, and its turn about up, rad, shape (3,); None where it is
            not known yet.
        fixed: whether its place is given, and not solved.
    """

    size: float
    place: Array | None = None
    fixed: bool = False

    def corners(self) -> Array:
        """Return its corners on the floor, m, shape (4, 3).

        Raises:
            ValueError: its place is not known.
        """
        if self.place is None:
            raise ValueError("a tag whose place is not known")
        return on_floor(self.size, self.place)


@dataclass(frozen=True)
class Room:
    """What stays the same while a film is made.

    Attributes:
        lens: the lens.
        floor: the tags of the floor by number; all have a place.
        camera: pose of the floor in the frame of a camera that stands still; None for one that moves.
        error_px: RMS distance of the floor's corners from where they should be seen, pixels.
        sizes: edge of each of the floor's tags as the others let expect it, over what was given.
    """

    lens: Lens
    floor: Mapping[int, FloorTag]
    camera: Pose | None
    error_px: float
    sizes: Mapping[int, float]

    def camera_of(self, seen: Seen, before: Pose | None = None) -> Pose | None:
        """Return the pose of the floor in the camera's frame of a picture; None where no floor is seen.

        Args:
            seen: the corners in the picture.
            before: the pose in the picture before.
        """
        if self.camera is not None:
            return self.camera
        here = [number for number in self.floor if number in seen]
        if not here:
            return None
        points = np.concatenate([self.floor[n].corners() for n in here])
        directions = self.lens.directions(np.concatenate([seen[n] for n in here]))
        if before is not None:
            pose = fitted(points, directions, before)
            if pose is not None:
                return pose
        found = [pose for pose in poses_of(points, directions) if _above(pose)]
        return found[0] if found else None


def solved_room(
    frames: Sequence[Seen],
    floor: Mapping[int, FloorTag],
    size: tuple[int, int],
    settings: TrackSettings = DEFAULT,
) -> Room:
    """Solve lens, floor and camera.

    Args:
        frames: what is seen in each picture.
        floor: the tags of the floor by number; the first one seen is the origin if no place is known.
        size: width and height of a picture, pixels.
        settings: what is expected of a lens.

    Raises:
        GaitoptError: no tag of the floor is seen.
    """
    seen = {n: sum(n in frame for frame in frames) for n in floor}
    if not any(seen.values()):
        listed = ", ".join(map(str, floor))
        raise GaitoptError(f"the floor is not in view: none of its tags {listed} is seen")
    floor = {n: tag for n, tag in floor.items() if seen[n]}
    if all(tag.place is None for tag in floor.values()):
        first = min(floor)
        floor = floor | {first: replace(floor[first], place=np.zeros(3), fixed=True)}
    still = _still(frames, floor, settings)
    views = [_median(frames, floor)] if still else _sampled(frames, floor, settings)
    lens = Lens(size, settings.focal * max(size))
    floor, cameras = _first_guess(views, floor, lens)
    views = [view for view, camera in zip(views, cameras, strict=True) if camera is not None]
    known = [camera for camera in cameras if camera is not None]
    if not known:
        raise GaitoptError("the floor is not in view: its tags are seen, but not from above")
    return _refined(views, floor, lens, known, still, settings)


def _still(frames: Sequence[Seen], floor: Mapping[int, FloorTag], settings: TrackSettings) -> bool:
    """Return whether the camera stands still: the floor's corners stay where they are."""
    for number in floor:
        here = np.array([frame[number] for frame in frames if number in frame])
        if len(here) and np.quantile(np.abs(here - np.median(here, axis=0)), 0.98) > settings.still_px:
            return False
    return True


def _median(frames: Sequence[Seen], floor: Mapping[int, FloorTag]) -> Seen:
    return {n: np.median([frame[n] for frame in frames if n in frame], axis=0) for n in floor}


def _sampled(frames: Sequence[Seen], floor: Mapping[int, FloorTag], settings: TrackSettings) -> list[Seen]:
    """Return pictures spread over the film, those with most of the floor's tags."""
    views = [{n: frame[n] for n in floor if n in frame} for frame in frames]
    parts = np.array_split(np.arange(len(views)), min(settings.sampled, len(views)))
    best = [max(part, key=lambda i: len(views[i])) for part in parts]
    return [views[i] for i in best if views[i]]


def _first_guess(
    views: Sequence[Seen], floor: Mapping[int, FloorTag], lens: Lens
) -> tuple[dict[int, FloorTag], list[Pose | None]]:
    """Return the floor's tags with a place each, and the camera of each view that sees one of them."""
    found = dict(floor)
    cameras: list[Pose | None] = [None] * len(views)
    for _ in range(len(floor)):
        for index, view in enumerate(views):
            known = [n for n in view if found[n].place is not None]
            if not known:
                continue
            points = np.concatenate([found[n].corners() for n in known])
            poses = poses_of(points, lens.directions(np.concatenate([view[n] for n in known])))
            camera = next((pose for pose in poses if _above(pose)), None)
            if camera is None:
                continue
            cameras[index] = camera
            for n in view:
                if found[n].place is None:
                    found[n] = replace(found[n], place=_place(lens.directions(view[n]), camera))
        if all(tag.place is not None for tag in found.values()):
            break
    return {n: tag for n, tag in found.items() if tag.place is not None}, cameras


def _above(camera: Pose) -> bool:
    """Return whether a camera is above the floor."""
    return float((camera.turn.T @ camera.shift)[2]) < 0.0


def _place(directions: Array, camera: Pose) -> Array:
    """Return where on the floor the corners of a tag are: middle and turn, shape (3,)."""
    points = rays_on_floor(directions, camera)
    middle = points.mean(axis=0)
    along = points[1] - points[0] + points[2] - points[3]
    return np.array([middle[0], middle[1], np.arctan2(along[1], along[0])])


def rays_on_floor(directions: Array, camera: Pose) -> Array:
    """Return where directions, shape (n, 2), meet the floor, m, shape (n, 3)."""
    rays = np.column_stack([directions, np.ones(len(directions))]) @ camera.turn
    origin = -camera.turn.T @ camera.shift
    return np.asarray(origin - rays * (origin[2] / rays[:, 2:]))


def on_floor(size: float, place: Array) -> Array:
    """Return the corners of a tag on the floor, m, shape (4, 3); for its place see `FloorTag`."""
    x, y, turn = place
    c, s = np.cos(turn), np.sin(turn)
    own = tag_corners(size)
    return np.column_stack([x + c * own[:, 0] - s * own[:, 1], y + s * own[:, 0] + c * own[:, 1], own[:, 2]])


def _refined(
    views: Sequence[Seen],
    floor: Mapping[int, FloorTag],
    lens: Lens,
    cameras: Sequence[Pose],
    still: bool,
    settings: TrackSettings,
) -> Room:
    """Solve lens, loose tags and cameras together."""
    loose = [n for n, tag in floor.items() if not tag.fixed]
    places = {n: tag.place for n, tag in floor.items() if tag.place is not None}
    begin = np.concatenate(
        [
            np.zeros(3),
            *(places[n] for n in loose),
            *(np.concatenate([Rotation.from_matrix(c.turn).as_rotvec(), c.shift]) for c in cameras),
        ]
    )
    free = 3 + 3 * len(loose)
    seen = [(i, n, view[n]) for i, view in enumerate(views) for n in view if n in floor]

    def lens_of(x: Array) -> Lens:
        k1, k2 = settings.distortion * x[1:3]
        return replace(lens, focal=lens.focal * float(np.exp(settings.focal_spread * x[0])), k1=k1, k2=k2)

    pixels = np.array([pixels for _, _, pixels in seen])
    view_of = np.array([i for i, _, _ in seen])
    rows = {n: np.array([k for k, (_, m, _) in enumerate(seen) if m == n], dtype=int) for n in loose}
    lying = np.array([on_floor(floor[n].size, places[n]) for _, n, _ in seen])

    def residuals(x: Array) -> Array:
        poses = x[free:].reshape(-1, 6)
        turns = Rotation.from_rotvec(poses[:, :3]).as_matrix()
        corners = lying
        for i, n in enumerate(loose):
            corners = corners.copy() if i == 0 else corners
            corners[rows[n]] = on_floor(floor[n].size, x[3 + 3 * i : 6 + 3 * i])
        ahead = np.einsum("ncj,nij->nci", corners, turns[view_of]) + poses[view_of, None, 3:]
        away = (lens_of(x).pixels(ahead) - pixels) / _CORNER_PX
        return np.concatenate([x[:3], np.clip(away.ravel(), -1e6, 1e6)])

    def slopes(x: Array) -> Array:
        """Difference quotients; a pose changes its own view alone, so those of all poses take one step."""
        middle = residuals(x)
        found = np.zeros((len(middle), len(x)))
        for i in range(free):
            found[:, i] = (residuals(x + _QUOTIENT * (np.arange(len(x)) == i)) - middle) / _QUOTIENT
        own = np.concatenate([np.full(3, -1), np.repeat(view_of, 8)])
        for part in range(6):
            moved = x.copy()
            moved[free + part :: 6] += _QUOTIENT
            change = (residuals(moved) - middle) / _QUOTIENT
            for view in range(len(cameras)):
                found[own == view, free + 6 * view + part] = change[own == view]
        return found

    solved = least_squares(
        residuals, begin, jac=slopes, method="trf", loss="soft_l1", f_scale=5.0, x_scale="jac", max_nfev=60
    )
    x = solved.x
    spread = np.linalg.pinv(solved.jac.T @ solved.jac)
    now = lens_of(x)
    now = replace(now, focal_sd=float(now.focal * settings.focal_spread * np.sqrt(spread[0, 0])))
    placed = dict(floor) | {n: replace(floor[n], place=x[3 + 3 * i : 6 + 3 * i]) for i, n in enumerate(loose)}
    first = x[free : free + 6]
    camera = Pose(Rotation.from_rotvec(first[:3]).as_matrix(), first[3:]) if still else None
    error = float(np.sqrt(np.mean(np.square(residuals(x)[3:])))) * _CORNER_PX
    poses = [Pose(Rotation.from_rotvec(p[:3]).as_matrix(), p[3:]) for p in x[free:].reshape(-1, 6)]
    return Room(now, placed, camera, error, _sizes(views, placed, now, poses))


def _sizes(
    views: Sequence[Seen], floor: Mapping[int, FloorTag], lens: Lens, cameras: Sequence[Pose]
) -> dict[int, float]:
    """Return the edge of each tag as it lies on the floor in the pictures, over what was given."""
    found: dict[int, list[float]] = {}
    for view, camera in zip(views, cameras, strict=True):
        for n in (n for n in view if n in floor):
            there = rays_on_floor(lens.directions(view[n]), camera)
            edge = np.linalg.norm(there - np.roll(there, 1, axis=0), axis=1).mean()
            found.setdefault(n, []).append(float(edge) / floor[n].size)
    return {n: float(np.median(ratios)) for n, ratios in found.items()}
