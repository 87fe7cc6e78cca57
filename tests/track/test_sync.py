"""When the gait began: a lamp lights up, a tag begins to move, or it is said; else it is not known."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from gaitopt.core.streams import seeded
from gaitopt.report.film.stage import Stand, looking
from gaitopt.track.lens import Lens
from gaitopt.track.pose import Pose
from gaitopt.track.room import FloorTag, Room
from gaitopt.track.shutter import said_readout
from gaitopt.track.sync import FrameMark, Lamp, LampMark, first_motion, lit
from gaitopt.track.tag import corners

Array = NDArray[np.float64]

TIME = np.arange(40) / 30.0
LENS = Lens((640, 480), 500.0)
CAMERA = Pose(*looking(Stand((0.0, -0.4, 0.3), (0.0, 0.0, 0.0))))
ROOM = Room(LENS, {100: FloorTag(0.04, np.zeros(3), fixed=True)}, CAMERA, 0.03, {})


def levels(begin_s: float, exposure_s: float = 0.01, lit_by: float = 120.0) -> Array:
    """Brightness of a lamp that lights up at a time, with noise."""
    share = np.clip((TIME + 0.5 * exposure_s - begin_s) / exposure_s, 0.0, 1.0)
    return 60.0 + lit_by * share + 3.0 * seeded(4).standard_normal(len(TIME))


@pytest.mark.parametrize("begin_s", [0.5, 0.503, 0.517, 0.53])
def test_a_lamp_lights_up_between_two_pictures_or_in_one(begin_s: float) -> None:
    found = lit(TIME, levels(begin_s), "the lamp")
    assert found.at_s == pytest.approx(begin_s, abs=0.5 / 30.0)
    assert abs(found.at_s - begin_s) < 2.0 * found.sd_s + 1e-9


def test_what_is_no_lamp_that_lights_up_is_not_known() -> None:
    always, never, late = levels(-1.0), levels(9.0), levels(1.29)
    flash = np.where(np.arange(40) == 20, 200.0, 60.0)
    blinks = np.where(np.arange(40) % 12 == 3, 200.0, np.where(np.arange(40) > 20, 200.0, 60.0))
    unseen = np.where(np.arange(40) < 21, np.nan, levels(0.7))
    for series in (always, never, late, flash, blinks, unseen):
        assert lit(TIME, series, "the lamp").at_s is None


def test_a_lamp_is_followed_as_the_camera_moves() -> None:
    lamp = Lamp(LampMark(100.0, 200.0), [100])
    for index in range(30):
        shift = np.array([2.0 * index, -1.0 * index])
        picture = np.full((480, 640), 50, np.uint8)
        x, y = (np.array([100, 200]) + shift).astype(int)
        picture[y - 2 : y + 3, x - 2 : x + 3] = 220 if index >= 12 else 60
        square = np.array([[300.0, 300.0], [340.0, 300.0], [340.0, 340.0], [300.0, 340.0]])
        lamp.look(picture, {100: square + shift})
    assert lamp.sync(TIME[:30]).at_s == pytest.approx(11.5 / 30.0)


def tag_at(x: float) -> Array:
    return LENS.pixels(CAMERA.of(corners(0.02) + np.array([x, 0.0, 0.0])))


def test_a_tag_that_rests_and_moves_shows_the_beginning() -> None:
    rng = seeded(5)
    frames = [
        {3: tag_at(0.1 * max(t - 0.6, 0.0)) + 0.03 * rng.standard_normal((4, 2)), 100: tag_at(0.1)}
        for t in TIME
    ]
    cameras = [CAMERA] * len(TIME)
    found = first_motion(3, TIME, frames, cameras, ROOM)
    assert found.at_s == pytest.approx(0.6, abs=0.04)
    assert first_motion(100, TIME, frames, cameras, ROOM).at_s is None
    assert first_motion(7, TIME, frames, cameras, ROOM).at_s is None
    moving = [{3: tag_at(0.1 * t)} for t in TIME]
    assert first_motion(3, TIME, moving, cameras, ROOM).at_s is None


def test_a_picture_that_is_said_is_that_of_the_film() -> None:
    assert FrameMark(15).sync(TIME).at_s == pytest.approx(0.5)
    assert FrameMark(40).sync(TIME).how == "picture 40 was said; the film has 0 to 39"


@pytest.mark.parametrize(("quarters", "corner"), [(0, (0, 1)), (1, (1, 0)), (2, (0, -1)), (3, (-1, 0))])
def test_the_readout_turns_with_the_picture(quarters: int, corner: tuple[float, float]) -> None:
    sensor = np.zeros((4, 6))
    sensor[-1] = 1.0  # the row that is read last
    turned = np.rot90(sensor, quarters)
    rows, columns = np.nonzero(turned)
    last = np.array([columns.mean() / (turned.shape[1] - 1), rows.mean() / (turned.shape[0] - 1)]) - 0.5
    assert said_readout(1.0, quarters) == pytest.approx(2.0 * last)
    assert math.hypot(*corner) == pytest.approx(1.0)
    assert said_readout(1.0, quarters) == pytest.approx(corner)
