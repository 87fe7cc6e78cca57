"""A rolling shutter in a moving hand is found, and what it does to the pictures is undone."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.core.streams import seeded
from gaitopt.report.film.stage import Stand, looking, sheet_at
from gaitopt.track import shutter
from gaitopt.track.floor_sheet import SHEET_TAG_MM
from gaitopt.track.lens import Lens
from gaitopt.track.path import cameras_of
from gaitopt.track.pose import Pose
from gaitopt.track.room import FloorTag, solved_room
from gaitopt.track.shutter import readout_of, straightened

Array = NDArray[np.float64]

LENS = Lens((1920, 1080), 1480.0, 0.05, -0.03)
TIMES = np.arange(45) / 30.0


def camera(at: float) -> Pose:
    """A camera in a hand, at a time, s."""
    turn, shift = looking(Stand((0.05, -0.4, 0.32), (0.05, 0.0, 0.0)))
    sway = 0.01 * np.array([np.sin(9.0 * at), np.sin(7.0 * at + 1.0), np.sin(5.0 * at + 2.0)])
    return Pose(Rotation.from_rotvec(sway).as_matrix() @ turn, shift + 0.2 * sway)


def floor() -> dict[int, FloorTag]:
    edge = 1e-3 * SHEET_TAG_MM
    return {
        n: FloorTag(edge, np.array([*xy, t]), fixed=True) for n, (xy, t, _) in sheet_at(0.05, 0.0).items()
    }


def filmed(readout: Array) -> list[dict[int, Array]]:
    """The corners of the floor sheet, each seen when its row and column are read."""
    rng = seeded(8)
    frames = []
    for at in TIMES:
        frame = {}
        for number, tag in floor().items():
            points = tag.corners()
            pixels = LENS.pixels(camera(at).of(points))
            for _ in range(4):
                late = (pixels / np.array(LENS.size) - 0.5) @ readout
                pixels = np.array(
                    [LENS.pixels(camera(at + t).of(p)) for t, p in zip(late, points, strict=True)]
                )
            frame[number] = pixels + 0.02 * rng.standard_normal((4, 2))
        frames.append(frame)
    return frames


@pytest.mark.parametrize("readout", [(0.0, 0.015), (0.0, -0.02), (0.012, 0.0)])
def test_the_readout_is_found_whichever_way_the_phone_is_held(readout: tuple[float, float]) -> None:
    frames = filmed(np.array(readout))
    room = solved_room(frames, floor(), LENS.size)
    assert room.camera is None
    found = readout_of(TIMES, frames, cameras_of(frames, room), room)
    assert found == pytest.approx(readout, abs=1.5e-3)


def test_the_camera_is_better_known_when_the_shutter_is() -> None:
    frames = filmed(np.array([0.0, 0.015]))
    room = solved_room(frames, floor(), LENS.size)
    rolled = cameras_of(frames, room)
    straight = straightened(TIMES, frames, rolled, room, readout_of(TIMES, frames, rolled, room))
    better = solved_room(straight, floor(), LENS.size)
    assert better.error_px < 0.8 * room.error_px
    errors = []
    for cameras in (rolled, cameras_of(straight, better)):
        away = [
            c.turn.T @ c.shift - camera(t).turn.T @ camera(t).shift
            for c, t in zip(cameras, TIMES, strict=True)
            if c
        ]
        errors.append(np.sqrt(np.mean(np.square(away))))
    assert errors[1] < 0.8 * errors[0]


def test_what_was_undone_is_what_is_said_although_a_second_look_is_not_sure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    frames = filmed(np.array([0.0, 0.015]))
    looks = iter([np.array([0.0, 0.014]), np.zeros(2)])
    monkeypatch.setattr(shutter, "readout_of", lambda *_: next(looks))
    found = shutter.unrolled(TIMES, frames, solved_room(frames, floor(), LENS.size), floor())
    assert found.readout.tolist() == [0.0, 0.014]
    assert found.frames is not frames
    assert next(looks, None) is None


def test_a_shutter_that_does_not_roll_is_left_alone() -> None:
    frames = filmed(np.zeros(2))
    room = solved_room(frames, floor(), LENS.size)
    assert np.abs(readout_of(TIMES, frames, cameras_of(frames, room), room)).max() < 5e-4
