"""A rolling shutter: lower rows are seen later, from where camera and robot are by then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.track import readout as readouts
from gaitopt.track.bodies import TaggedRobot
from gaitopt.track.path import Path, cameras_of, path_of
from gaitopt.track.pose import Pose
from gaitopt.track.readout import Readout
from gaitopt.track.room import FloorTag, Room, Seen, solved_room
from gaitopt.track.settings import DEFAULT, TrackSettings
from gaitopt.track.sweep import Sweep, rows_of, sweeps_of

Array = NDArray[np.float64]

_ROUNDS = 2
"""Rounds in which shutter, lens and cameras are solved."""

_SAME_S = 5e-4
"""A change of the readout that changes nothing else, s."""


@dataclass(frozen=True)
class Unrolled:
    """What is seen in a film, as a shutter that does not roll would see it.

    Attributes:
        frames: corners in each picture.
        room: lens and floor.
        cameras: pose of the floor in the camera's frame of each picture.
        paths: the path of each tagged body of the robot.
        readout: how much later the last column and the last row were seen than the first.
    """

    frames: Sequence[Seen]
    room: Room
    cameras: Sequence[Pose | None]
    paths: Sequence[Path]
    readout: Readout


def unrolled(
    times: Array,
    frames: Sequence[Seen],
    room: Room,
    floor: Mapping[int, FloorTag],
    robot: TaggedRobot,
    settings: TrackSettings = DEFAULT,
    said: Array | None = None,
    quarters: int = 0,
) -> Unrolled:
    """Return what a shutter that does not roll would see.

    Its readout is what a moving camera shows, or what a moving robot shows to one that stands.

    Args:
        times: time stamps of the pictures, s, shape (n,).
        frames: the corners in them.
        room: lens and floor, solved from them.
        floor: the tags of the floor, as for `solved_room`.
        robot: the robot with its tags.
        settings: what is expected of a lens and a shutter.
        said: the readout, if it is known, s, shape (2,).
        quarters: how often the pictures were turned by 90 degrees to the left, to stand upright.

    Raises:
        GaitoptError: the floor is not in view.
    """
    sweeps = sweeps_of(times, frames)
    expected = np.abs(said_readout(settings.readout_s, quarters))
    readout = Readout(np.zeros(2), expected)
    straight, cameras = frames, cameras_of(frames, room, settings)
    paths: list[Path] = []
    for _ in range(_ROUNDS):
        if said is not None:
            shown = Readout(said, np.zeros(2))
        elif room.camera is None:
            shown = readouts.of_floor(frames, sweeps, cameras, room, expected)
        else:
            paths = [path_of(body, straight, cameras, room, settings) for body in robot.bodies]
            shown = readouts.of_robot(frames, sweeps, cameras, room, robot, paths, expected, settings)
        change = float(np.abs(shown.seconds - readout.seconds).max())
        readout = shown
        if change < _SAME_S:
            break
        straight, paths = straightened(frames, sweeps, readout.seconds, room.lens.size), []
        if room.camera is None:
            room = solved_room(straight, floor, room.lens.size, settings)
            cameras = cameras_of(straight, room, settings)
    paths = paths or [path_of(body, straight, cameras, room, settings) for body in robot.bodies]
    unsure = [
        doubts(seen, sweep, readout, room.lens.size) for seen, sweep in zip(straight, sweeps, strict=True)
    ]
    pairs = zip(robot.bodies, paths, strict=True)
    paths = [path.doubted(body, cameras, unsure, room.lens.focal) for body, path in pairs]
    return Unrolled(straight, room, cameras, paths, readout)


def straightened(
    frames: Sequence[Seen], sweeps: Sequence[Sweep], readout: Array, size: tuple[int, int]
) -> Sequence[Seen]:
    """Return the corners in each picture as a shutter that does not roll would see them, pixels.

    Args:
        frames: the corners in each picture.
        sweeps: how they move there.
        readout: how much later the last column and the last row are seen than the first, s, shape (2,).
        size: width and height of a picture, pixels.
    """
    if not readout.any():
        return frames
    return [
        {
            n: corners - sweep[n].speed * (rows_of(corners, size) @ readout)[:, None]
            for n, corners in seen.items()
        }
        for seen, sweep in zip(frames, sweeps, strict=True)
    ]


def doubts(seen: Seen, sweep: Sweep, readout: Readout, size: tuple[int, int]) -> dict[int, Array]:
    """Return how far the corners of each tag may still be off, in ways that are independent of each other.

    Args:
        seen: the corners in a picture.
        sweep: how they move there.
        readout: what is known of the shutter.
        size: width and height of a picture, pixels.

    Returns:
        By number, standard deviations, pixels, shape (4, 4, 2): of the readout along the picture and down,
        and of the tag's speed along and down.
    """
    found = {}
    for number, corners in seen.items():
        rows, motion = rows_of(corners, size), sweep[number]
        late = (rows @ readout.seconds)[:, None]
        by_readout = [motion.speed * (rows[:, k] * readout.sd[k])[:, None] for k in range(2)]
        by_speed = [late * motion.sd * axis for axis in np.eye(2)]
        found[number] = np.stack([*by_readout, *by_speed])
    return found


def said_readout(readout_s: float, quarters: int) -> Array:
    """Return how much later the last column and the last row of an upright picture are seen, s, shape (2,).

    Args:
        readout_s: the same of the last row as the phone reads them, s.
        quarters: how often the picture was turned by 90 degrees to the left, to stand upright.
    """
    return readout_s * np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][quarters % 4])
