"""A rolling shutter: lower rows are seen later, from where a moving camera is by then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.track.path import cameras_of
from gaitopt.track.pose import Pose, fitted
from gaitopt.track.room import FloorTag, Room, Seen, rays_on_floor, solved_room
from gaitopt.track.settings import DEFAULT, TrackSettings

Array = NDArray[np.float64]

LONGEST_S = 0.05
"""No phone takes longer to read a picture, s."""

_SURE = 4.0
"""A shutter counts as rolling if its time is this many standard deviations from 0."""

_FEWEST = 12
"""Fewest corners of the floor in a picture that tells something of the shutter."""

_ROUNDS = 2
"""Rounds in which shutter, lens and cameras are solved."""


@dataclass(frozen=True)
class Unrolled:
    """What is seen in a film, as a shutter that does not roll would see it.

    Attributes:
        frames: corners in each picture.
        room: lens and floor.
        cameras: pose of the floor in the camera's frame of each picture.
        readout: how much later the last column and the last row were seen than the first, s, shape (2,).
    """

    frames: Sequence[Seen]
    room: Room
    cameras: Sequence[Pose | None]
    readout: Array


def unrolled(
    times: Array,
    frames: Sequence[Seen],
    room: Room,
    floor: Mapping[int, FloorTag],
    settings: TrackSettings = DEFAULT,
    said: Array | None = None,
) -> Unrolled:
    """Return what a shutter that does not roll would see; of a camera on a stand, what is seen.

    Args:
        times: time stamps of the pictures, s, shape (n,).
        frames: the corners in them.
        room: lens and floor, solved from them.
        floor: the tags of the floor, as for `solved_room`.
        settings: what is expected of a lens.
        said: the readout, if it is known, s, shape (2,).

    Raises:
        GaitoptError: the floor is not in view.
    """
    readout = np.zeros(2) if said is None else said
    found = Unrolled(frames, room, cameras_of(frames, room, settings), readout)
    for _ in range(_ROUNDS if room.camera is None else 0):
        readout = readout_of(times, frames, found.cameras, found.room) if said is None else said
        if not readout.any():
            break
        straight = straightened(times, frames, found.cameras, found.room, readout)
        solved = solved_room(straight, floor, room.lens.size, settings)
        found = Unrolled(straight, solved, cameras_of(straight, solved, settings), readout)
    return found


def readout_of(times: Array, frames: Sequence[Seen], cameras: Sequence[Pose | None], room: Room) -> Array:
    """Return how much later the last column and the last row are seen than the first, s, shape (2,).

    What a moving camera's shutter does to the tags of the floor, no pose of the camera explains. A phone that
    is held upright reads columns; one that is upside down reads backward.

    Args:
        times: time stamps of the pictures, s, shape (n,).
        frames: the corners in them.
        cameras: the floor's pose in the frame of the camera of each.
        room: lens and floor.

    Returns:
        The two times; 0 where they are not known well.
    """
    normal, pull, square, count = np.zeros((2, 2)), np.zeros(2), 0.0, 0
    for seen, camera, motion in zip(frames, cameras, motions(times, cameras), strict=True):
        here = [number for number in room.floor if number in seen]
        if camera is None or motion is None or 4 * len(here) < _FEWEST:
            continue
        points = np.concatenate([room.floor[n].corners() for n in here])
        pixels = np.concatenate([seen[n] for n in here])
        fit = fitted(points, room.lens.directions(pixels), camera)
        if fit is None:
            continue
        left = (pixels - room.lens.pixels(fit.of(points))).ravel()
        slopes = np.stack(
            [
                (room.lens.pixels(_moved(fit, step).of(points)) - room.lens.pixels(fit.of(points))).ravel()
                / 1e-6
                for step in 1e-6 * np.eye(6)
            ],
            axis=1,
        )
        rolled = _rate(points, pixels, fit, motion, room)
        free = np.linalg.qr(slopes)[0]
        left, rolled = left - free @ (free.T @ left), rolled - free @ (free.T @ rolled)
        normal += rolled.T @ rolled
        pull += rolled.T @ left
        square += float(left @ left)
        count += len(left) - 6
    if count == 0 or np.linalg.matrix_rank(normal) < 2:
        return np.zeros(2)
    readout = np.linalg.solve(normal, pull)
    spread = np.sqrt(np.diag(np.linalg.inv(normal)) * max(square - pull @ readout, 0.0) / count)
    known = (np.abs(readout) > _SURE * spread) & (np.abs(readout) < LONGEST_S)
    return np.where(known, readout, 0.0)


def straightened(
    times: Array, frames: Sequence[Seen], cameras: Sequence[Pose | None], room: Room, readout: Array
) -> list[Seen]:
    """Return the corners in each picture as a shutter that does not roll would see them, pixels.

    Args:
        times, frames, cameras, room: as for `readout_of`.
        readout: how much later the last column and the last row are seen than the first, s, shape (2,).
    """
    found: list[Seen] = []
    for seen, camera, motion in zip(frames, cameras, motions(times, cameras), strict=True):
        if camera is None or motion is None or not seen:
            found.append(seen)
            continue
        pixels = np.concatenate(list(seen.values()))
        points = rays_on_floor(room.lens.directions(pixels), camera)
        late = (_rate(points, pixels, camera, motion, room) @ readout).reshape(-1, 4, 2)
        found.append({n: seen[n] - away for n, away in zip(seen, late, strict=True)})
    return found


def motions(times: Array, cameras: Sequence[Pose | None]) -> list[Array | None]:
    """Return how each camera turns and shifts, rad/s and m/s, shape (6,), from the pictures beside it."""
    found: list[Array | None] = []
    for index in range(len(cameras)):
        before, after = cameras[max(index - 1, 0)], cameras[min(index + 1, len(cameras) - 1)]
        if before is None or after is None or cameras[index] is None:
            found.append(None)
            continue
        span = times[min(index + 1, len(cameras) - 1)] - times[max(index - 1, 0)]
        turn = Rotation.from_matrix(after.turn @ before.turn.T).as_rotvec()
        found.append(np.concatenate([turn, after.shift - before.shift]) / span)
    return found


def said_readout(readout_s: float, quarters: int) -> Array:
    """Return how much later the last column and the last row of an upright picture are seen, s, shape (2,).

    Args:
        readout_s: the same of the last row as the phone reads them, s.
        quarters: how often the picture was turned by 90 degrees to the left, to stand upright.
    """
    return readout_s * np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][quarters % 4])


def lateness(tags: Iterable[int], frames: Sequence[Seen], size: tuple[int, int], readout: Array) -> Array:
    """Return how much later than a picture's stamp, which is that of its middle, some tags are seen, s, (n,).

    Args:
        tags: the tags.
        frames: the corners in each picture.
        size: width and height of a picture, pixels.
        readout: how much later the last column and the last row are seen than the first, s, shape (2,).
    """
    late = np.zeros(len(frames))
    for index, seen in enumerate(frames):
        here = [seen[number] for number in tags if number in seen]
        if here:
            late[index] = (np.mean(np.concatenate(here), axis=0) / np.array(size) - 0.5) @ readout
    return late


def _moved(camera: Pose, step: Array) -> Pose:
    return Pose(Rotation.from_rotvec(step[:3]).as_matrix() @ camera.turn, camera.shift + step[3:])


def _rate(points: Array, pixels: Array, camera: Pose, motion: Array, room: Room) -> Array:
    """Return how far corners are seen from where they were, for a readout of 1 s, pixels, shape (2 n, 2)."""
    step = 1e-4
    lens = room.lens
    rate = (lens.pixels(_moved(camera, step * motion).of(points)) - lens.pixels(camera.of(points))) / step
    late = pixels / np.array(lens.size) - 0.5
    return np.asarray((rate[:, :, None] * late[:, None, :]).reshape(-1, 2))
