"""How long a phone takes to read a picture, as a moving camera or a moving robot shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.track.bodies import Link, TaggedRobot
from gaitopt.track.lens import Lens
from gaitopt.track.path import Path
from gaitopt.track.pose import Pose, fitted
from gaitopt.track.room import Room, Seen
from gaitopt.track.settings import DEFAULT, TrackSettings
from gaitopt.track.sweep import Sweep, rows_of

Array = NDArray[np.float64]

LONGEST_S = 0.05
"""No phone takes longer to read a picture, s."""

_SURE = 4.0
"""A phone reads across what its film says, if that time is so many standard deviations from 0."""

_FEWEST = 12
"""Fewest corners of the floor in a picture that tells something of the shutter."""

_MOST = 60
"""Most pictures in which the robot is looked at: those in which it moves fastest."""

_PICTURES = 5
"""Fewest pictures that tell something of the shutter."""

_STEP = 1e-6


@dataclass(frozen=True)
class Readout:
    """How much later the last column and the last row of an upright picture are seen than the first.

    Attributes:
        seconds: the two times, s, shape (2,).
        sd: their standard deviations, s, shape (2,).
    """

    seconds: Array
    sd: Array

    @property
    def main(self) -> float:
        """The time along the direction in which the phone reads, s."""
        return float(self.seconds[np.argmax(np.abs(self.seconds))])


@dataclass(frozen=True)
class _View:
    """Corners in a picture beside those of something rigid.

    Attributes:
        left: how far they are from where it puts them, pixels, shape (m,).
        slopes: how these change as it moves, shape (m, k).
        rolled: how far they are seen from where they were, for a readout of 1 s, pixels, shape (m, 2).
    """

    left: Array
    slopes: Array
    rolled: Array


def of_floor(
    frames: Sequence[Seen],
    sweeps: Sequence[Sweep],
    cameras: Sequence[Pose | None],
    room: Room,
    expected: Array,
) -> Readout:
    """Return the readout that the tags of the floor show to a camera that moves.

    What the shutter does to them, no pose of the camera explains. A phone that is held upright reads columns;
    one that is upside down reads backward.

    Args:
        frames: the corners in each picture.
        sweeps: how they move there.
        cameras: the floor's pose in the frame of the camera of each.
        room: lens and floor.
        expected: standard deviations of the two times before the film is seen, s, shape (2,). One of 0 is
            the time across the direction in which the film says that the phone reads: it is believed if the
            pictures leave no doubt.
    """
    return _solved(_floor_views(frames, sweeps, cameras, room), expected)


def of_robot(
    frames: Sequence[Seen],
    sweeps: Sequence[Sweep],
    cameras: Sequence[Pose | None],
    room: Room,
    robot: TaggedRobot,
    paths: Sequence[Path],
    expected: Array,
    settings: TrackSettings = DEFAULT,
) -> Readout:
    """Return the readout that the tags of the robot show.

    What the shutter does to the tag of one body looks like another pose of it. Two bodies with fewer than six
    joints between them do not turn as freely as that.

    Args:
        frames, sweeps, cameras, room: as for `of_floor`.
        robot: the robot with its tags.
        paths: the path of each of its bodies.
        expected: as for `of_floor`.
        settings: what is an outlier.
    """
    by_site = {body.site: path for body, path in zip(robot.bodies, paths, strict=True)}
    views: list[_View] = []
    for link in robot.links():
        pair = (by_site[link.one.site], by_site[link.other.site])
        views += _link_views(link, pair, frames, sweeps, cameras, room, settings)
    return _solved(views, expected)


def _solved(views: Iterable[_View], expected: Array) -> Readout:
    """Return the readout that explains best what rigid things leave unexplained, and what is expected."""
    normals, pulls, square, count = [], [], 0.0, 0
    for view in views:
        free = np.linalg.qr(view.slopes)[0]
        left, rolled = (part - free @ (free.T @ part) for part in (view.left, view.rolled))
        normals.append(rolled.T @ rolled)
        pulls.append(rolled.T @ left)
        square += float(left @ left)
        count += len(left) - view.slopes.shape[1]
    normal, pull = sum(normals, np.zeros((2, 2))), sum(pulls, np.zeros(2))
    if len(normals) < _PICTURES or np.linalg.matrix_rank(normal) < 2:
        return Readout(np.zeros(2), expected)
    both = np.linalg.solve(normal, pull)
    # Errors are chance, and what the corners of one picture have in common.
    scatter = np.array([p - n @ both for n, p in zip(normals, pulls, strict=True)])
    covariance = scatter.T @ scatter + max(square - float(pull @ both), 0.0) / count * normal
    sure = np.abs(both) > _SURE * np.sqrt(np.diag(_around(normal, covariance)))
    seconds, sd = np.zeros(2), np.zeros(2)
    free = np.flatnonzero((sure & (np.abs(both) < LONGEST_S)) | (expected > 0.0))
    if len(free):
        own = np.ix_(free, free)
        weight = np.linalg.pinv(_around(normal[own], covariance[own]))
        prior = np.diag([1.0 / expected[k] ** 2 if expected[k] else 0.0 for k in free])
        seconds[free] = np.linalg.solve(weight + prior, weight @ np.linalg.solve(normal[own], pull[free]))
        sd[free] = np.sqrt(np.diag(np.linalg.inv(weight + prior)))
    return Readout(np.clip(seconds, -LONGEST_S, LONGEST_S), sd)


def _around(normal: Array, covariance: Array) -> Array:
    """Return the covariance of a least-squares solution from that of its right-hand side."""
    inverse = np.linalg.inv(normal)
    return np.asarray(inverse @ covariance @ inverse)


def _floor_views(
    frames: Sequence[Seen], sweeps: Sequence[Sweep], cameras: Sequence[Pose | None], room: Room
) -> Iterator[_View]:
    for seen, sweep, camera in zip(frames, sweeps, cameras, strict=True):
        here = [number for number in room.floor if number in seen]
        if camera is None or 4 * len(here) < _FEWEST:
            continue
        points = np.concatenate([room.floor[n].corners() for n in here])
        pixels = np.concatenate([seen[n] for n in here])
        fit = fitted(points, room.lens.directions(pixels), camera)
        if fit is not None:
            start = replace(fit, spread=None)

            def placed(x: Array, points: Array = points, start: Pose = start) -> Array:
                return _moved(start, x).of(points)

            rolled = _rolled(here, seen, sweep, room.lens)
            yield _view(placed, np.zeros(6), pixels, room.lens, rolled)


def _link_views(
    link: Link,
    paths: tuple[Path, Path],
    frames: Sequence[Seen],
    sweeps: Sequence[Sweep],
    cameras: Sequence[Pose | None],
    room: Room,
    settings: TrackSettings,
) -> list[_View]:
    """Return two bodies with joints between them in the pictures in which they move fastest."""
    numbers = [*link.one.tags, *link.other.tags]
    speeds = [max((sweep[n].fastest for n in numbers if n in sweep), default=0.0) for sweep in sweeps]
    noise = 0.5 * (paths[0].noise + paths[1].noise)
    views = []
    last: Array | None = None
    for index in sorted(np.argsort(speeds)[::-1][:_MOST].tolist()):
        one, other, camera = paths[0].poses[index], paths[1].poses[index], cameras[index]
        if one is None or other is None or camera is None:
            continue
        limit = settings.outlier**2 * noise * (6 - len(link.joints))
        solved = None if last is None else link.angles(one, other, last)
        if solved is None or solved.error > limit:
            solved = link.angles(one, other, None)
        last = None
        if solved is None or solved.error > limit:
            continue
        last = solved.values
        seen = frames[index]
        here = [[n for n in body.tags if n in seen] for body in (link.one, link.other)]
        points = [
            np.concatenate([body.tags[n] for n in own])
            for body, own in zip((link.one, link.other), here, strict=True)
        ]

        def placed(x: Array, one: Pose = one, camera: Pose = camera, points: list[Array] = points) -> Array:
            first = _moved(one, x[:6])
            turn, shift = link.relative(x[6:])
            second = Pose(first.turn @ turn, first.of(shift))
            return camera.of(np.concatenate([first.of(points[0]), second.of(points[1])]))

        numbers = [*here[0], *here[1]]
        pixels = np.concatenate([seen[n] for n in numbers])
        rolled = _rolled(numbers, seen, sweeps[index], room.lens)
        views.append(_view(placed, np.r_[np.zeros(6), solved.values], pixels, room.lens, rolled))
    return views


def _view(placed: Callable[[Array], Array], at: Array, pixels: Array, lens: Lens, rolled: Array) -> _View:
    """Return corners beside those of something rigid.

    Args:
        placed: where its corners are in the camera's frame, m, by its free coordinates.
        at: the coordinates.
        pixels: where the corners are seen, shape (n, 2).
        lens: the lens.
        rolled: as for `_View`.
    """
    middle = lens.pixels(placed(at))
    slopes = [(lens.pixels(placed(at + step)) - middle).ravel() / _STEP for step in _STEP * np.eye(len(at))]
    return _View((pixels - middle).ravel(), np.stack(slopes, axis=1), rolled)


def _rolled(numbers: Sequence[int], seen: Seen, sweep: Sweep, lens: Lens) -> Array:
    """Return how far corners are seen from where they were, for a readout of 1 s, pixels, shape (2 n, 2)."""
    parts = [sweep[n].speed[:, :, None] * rows_of(seen[n], lens.size)[:, None, :] for n in numbers]
    return np.concatenate(parts).reshape(-1, 2)


def _moved(pose: Pose, step: Array) -> Pose:
    return Pose(Rotation.from_rotvec(step[:3]).as_matrix() @ pose.turn, pose.shift + step[3:])
