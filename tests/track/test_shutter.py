"""A rolling shutter is found, in a moving hand or by a moving robot, and what it does is undone."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.core.streams import seeded
from gaitopt.problem.problem import Problem
from gaitopt.report.film.stage import Stand, looking, sheet_at
from gaitopt.track import shutter
from gaitopt.track.bodies import TaggedRobot
from gaitopt.track.floor_sheet import SHEET_TAG_MM
from gaitopt.track.lens import Lens
from gaitopt.track.path import cameras_of
from gaitopt.track.pose import Pose
from gaitopt.track.readout import Readout, of_floor
from gaitopt.track.room import FloorTag, solved_room
from gaitopt.track.shutter import doubts, straightened
from gaitopt.track.sweep import TagMotion, sweeps_of

Array = NDArray[np.float64]

LENS = Lens((1920, 1080), 1480.0, 0.05, -0.03)
TIMES = np.arange(45) / 30.0
EXPECTED = np.array([0.0, 0.015])


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


def rolled(ahead: Callable[[float], Array], at: float, readout: Array) -> Array:
    """Where corners are seen, each when its row and column are read; `ahead` is where they are at a time."""
    late = np.zeros(len(ahead(at)))
    for _ in range(4):
        pixels = LENS.pixels(np.array([ahead(at + t)[i] for i, t in enumerate(late)]))
        late = (pixels / np.array(LENS.size) - 0.5) @ readout
    return pixels


def filmed(readout: Array) -> list[dict[int, Array]]:
    """The corners of the floor sheet, as a camera in a hand sees them."""
    rng = seeded(8)
    lying = {number: tag.corners() for number, tag in floor().items()}
    return [
        {
            n: rolled(lambda t, p=p: camera(t).of(p), at, readout) + 0.02 * rng.standard_normal((4, 2))
            for n, p in lying.items()
        }
        for at in TIMES
    ]


def walked(robot: TaggedRobot, readout: Array) -> list[dict[int, Array]]:
    """The corners of the sheet and of an ArcFold that hops and folds, as a camera on a stand sees them."""
    rng = seeded(9)
    (link,) = robot.links()
    base, tail = robot.bodies

    def ahead(t: float, number: int) -> Array:
        shift = np.array([0.02 * np.sin(11.0 * t), 0.1, 0.05 + 0.02 * np.sin(17.0 * t)])
        first = Pose(Rotation.from_rotvec([0.05 * np.sin(7.0 * t), 0.0, 0.0]).as_matrix() @ base.start, shift)
        turn, away = link.relative(np.array([0.9 + 0.4 * np.sin(6.0 * t)]))
        second = Pose(first.turn @ turn, first.of(away))
        body, pose = (base, first) if number in base.tags else (tail, second)
        return camera(0.0).of(pose.of(body.tags[number]))

    resting = {n: LENS.pixels(camera(0.0).of(tag.corners())) for n, tag in floor().items()}
    return [
        {
            n: rolled(lambda t, n=n: ahead(t, n), at, readout) + 0.02 * rng.standard_normal((4, 2))
            for n in robot.numbers()
        }
        | {n: corners + 0.02 * rng.standard_normal((4, 2)) for n, corners in resting.items()}
        for at in TIMES
    ]


def arcfold_robot(problem: Problem) -> TaggedRobot:
    return TaggedRobot.of(problem, {int(n): tag for n, tag in problem.file.tags.items()})


@pytest.mark.parametrize("readout", [(0.0, 0.015), (0.0, -0.02), (0.012, 0.0)])
def test_the_readout_is_found_whichever_way_the_phone_is_held(readout: tuple[float, float]) -> None:
    frames = filmed(np.array(readout))
    room = solved_room(frames, floor(), LENS.size)
    assert room.camera is None
    found = of_floor(frames, sweeps_of(TIMES, frames), cameras_of(frames, room), room, EXPECTED)
    assert found.seconds == pytest.approx(readout, abs=1.5e-3)
    assert (found.sd < 1e-3).all()


def test_the_camera_is_better_known_when_the_shutter_is() -> None:
    frames = filmed(np.array([0.0, 0.015]))
    room = solved_room(frames, floor(), LENS.size)
    rolled = cameras_of(frames, room)
    sweeps = sweeps_of(TIMES, frames)
    straight = straightened(
        frames, sweeps, of_floor(frames, sweeps, rolled, room, EXPECTED).seconds, LENS.size
    )
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


def test_a_shutter_that_does_not_roll_is_left_alone() -> None:
    frames = filmed(np.zeros(2))
    room = solved_room(frames, floor(), LENS.size)
    found = of_floor(frames, sweeps_of(TIMES, frames), cameras_of(frames, room), room, EXPECTED)
    assert np.abs(found.seconds).max() < 5e-4


@pytest.mark.parametrize("readout", [(0.0, 0.012), (0.0, -0.02), (0.015, 0.0), (0.0, 0.0)])
def test_a_robot_shows_the_readout_to_a_camera_on_a_stand(
    readout: tuple[float, float], arcfold: Problem
) -> None:
    robot = arcfold_robot(arcfold)
    frames = walked(robot, np.array(readout))
    room = solved_room(frames, floor(), LENS.size)
    assert room.camera is not None
    found = shutter.unrolled(TIMES, frames, room, floor(), robot)
    assert found.readout.seconds == pytest.approx(readout, rel=0.06, abs=1e-4)
    true = walked(robot, np.zeros(2))
    for n in robot.numbers():
        before, after = (
            np.mean([np.abs(there[n] - here[n]).mean() for here, there in zip(true, seen, strict=True)][1:-1])
            for seen in (frames, found.frames)
        )
        assert after <= 0.2 * before


def test_a_tag_is_put_where_it_was_at_the_time_of_the_picture() -> None:
    frames = [{3: np.full((4, 2), [0.0, 200.0 * t])} for t in TIMES - 0.5 * 0.02]
    straight = straightened(frames, sweeps_of(TIMES, frames), np.array([0.02, 0.0]), LENS.size)
    for at, seen in zip(TIMES, straight, strict=True):
        assert seen[3][:, 1] == pytest.approx(200.0 * at)


def test_the_speed_of_a_tag_is_not_known_better_than_it_changes() -> None:
    square = np.array([[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]])
    steady = [{3: square + np.array([600.0, 300.0 + 90.0 * t])} for t in TIMES]
    stopped = [{3: square + np.array([600.0, 300.0 + 90.0 * min(t, 0.5)])} for t in TIMES]
    lonely = [seen if i == 7 else {} for i, seen in enumerate(steady)]
    assert sweeps_of(TIMES, steady)[15][3].sd == pytest.approx([0.0, 0.0], abs=1e-9)
    assert sweeps_of(TIMES, stopped)[15][3].sd == pytest.approx([0.0, 45.0])
    assert sweeps_of(TIMES, lonely)[7][3].sd == pytest.approx([1200.0, 1200.0])


def test_what_the_shutter_may_have_done_is_stated() -> None:
    seen = {3: np.array([[900.0, 0.0], [1000.0, 0.0], [1000.0, 1080.0], [900.0, 1080.0]])}
    motion = {3: TagMotion(np.full((4, 2), [100.0, 0.0]), np.array([0.0, 30.0]))}
    known = Readout(np.array([0.0, 0.02]), np.array([0.0, 0.002]))
    along, down, speed_along, speed_down = doubts(seen, motion, known, LENS.size)[3]
    assert not along.any()
    assert not speed_along.any()
    assert down[:, 0] == pytest.approx([-0.1, -0.1, 0.1, 0.1])
    assert speed_down[:, 1] == pytest.approx([-0.3, -0.3, 0.3, 0.3])
