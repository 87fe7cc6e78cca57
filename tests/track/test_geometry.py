"""From corners to signals: lens, floor, poses and joints are recovered from what a camera would see."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import seeded
from gaitopt.problem.problem import Problem
from gaitopt.problem.tags import Tag
from gaitopt.report.film.stage import Stand, looking, sheet_at
from gaitopt.track import path as paths
from gaitopt.track import tracking
from gaitopt.track.bodies import TaggedRobot
from gaitopt.track.lens import Lens
from gaitopt.track.pose import Pose, turn_vector
from gaitopt.track.room import FloorTag, on_floor, solved_room
from gaitopt.track.tracking import Tracker, track_film

Array = NDArray[np.float64]

LENS = Lens((1920, 1080), 1480.0, 0.06, -0.04)
STAND = Stand((0.0, -0.42, 0.3), (0.0, 0.02, 0.02))
NOISE = 0.05


def camera(place: tuple[float, float, float] = STAND.place) -> Pose:
    return Pose(*looking(replace(STAND, place=place)))


def floor_seen(eye: Pose, rng: np.random.Generator, noise: float = NOISE) -> dict[int, Array]:
    """The corners of the floor sheet as a camera sees them."""
    return {
        n: seen(on_floor(edge, np.array([*place, turn])), eye, rng, noise)
        for n, (place, turn, edge) in sheet_at(0.0, 0.0).items()
    }


def seen(points: Array, eye: Pose, rng: np.random.Generator, noise: float = NOISE) -> Array:
    return LENS.pixels(eye.of(points)) + noise * rng.standard_normal((len(points), 2))


def sheet() -> dict[int, FloorTag]:
    return {
        n: FloorTag(edge, np.array([*place, turn]), fixed=True)
        for n, (place, turn, edge) in sheet_at(0.0, 0.0).items()
    }


def poses(robot: TaggedRobot, middle: Array) -> list[list[Pose]]:
    """The poses of an ArcFold's tagged bodies while its arch folds and it moves forward."""
    model = robot.model
    data = mujoco.MjData(model)
    (link,) = robot.links()
    found = []
    for index, angle in enumerate(middle):
        turn, shift = link.relative(np.array([angle]))
        data.qpos[:] = model.key_qpos[0]
        mujoco.mj_kinematics(model, data)
        site = data.site(robot.bodies[0].site)
        first = Pose(site.xmat.reshape(3, 3).copy(), site.xpos + np.array([-0.1 + 1e-3 * index, 0.12, 0.0]))
        found.append([first, Pose(first.turn @ turn, first.turn @ shift + first.shift)])
    return found


def frames_of(
    robot: TaggedRobot, where: Sequence[Sequence[Pose]], eyes: Sequence[Pose], noise: float = NOISE
) -> list[dict[int, Array]]:
    rng = seeded(4)
    frames = []
    for own, eye in zip(where, eyes, strict=True):
        frame = floor_seen(eye, rng, noise)
        for body, pose in zip(robot.bodies, own, strict=True):
            for number, points in body.tags.items():
                frame[number] = seen(pose.of(points), eye, rng, noise)
        frames.append(frame)
    return frames


def robot_of(problem: Problem) -> TaggedRobot:
    return TaggedRobot.of(problem, {int(n): tag for n, tag in problem.file.tags.items()})


def tracked(
    problem: Problem, frames: list[dict[int, Array]], monkeypatch: pytest.MonkeyPatch
) -> tracking.FilmTrack:
    """What tracking makes of given corners."""

    def given(*_: object) -> tuple[Array, list[dict[int, Array]], tuple[int, int], int]:
        return np.arange(len(frames)) / 30.0, frames, LENS.size, 0

    monkeypatch.setattr(tracking, "_seen", given)
    tags = {int(n): tag for n, tag in problem.file.tags.items()}
    return track_film(Path("walk.mp4"), Tracker.of(problem, tags))


def test_directions_undo_pixels() -> None:
    points = np.array([[0.1, -0.2, 1.0], [-0.3, 0.15, 0.8], [0.0, 0.0, 2.0]])
    assert LENS.directions(LENS.pixels(points)) == pytest.approx(points[:, :2] / points[:, 2:], abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.3, 1.6, 2.6, 3.14])
def test_a_turn_is_a_vector_along_its_axis(angle: float) -> None:
    vector = angle * np.array([0.36, -0.48, 0.8])
    assert turn_vector(Rotation.from_rotvec(vector).as_matrix()) == pytest.approx(vector, abs=1e-14)


def test_lens_and_camera_are_solved_from_one_view_of_the_sheet() -> None:
    rng = seeded(1)
    views = [floor_seen(camera(), rng) for _ in range(20)]
    room = solved_room(views, sheet(), LENS.size)
    assert room.camera is not None
    assert room.lens.focal == pytest.approx(LENS.focal, rel=5e-3)
    assert abs(room.lens.focal - LENS.focal) < 4 * room.lens.focal_sd
    place = -room.camera.turn.T @ room.camera.shift
    assert place == pytest.approx(STAND.place, abs=2e-3)


def test_loose_tags_on_the_floor_are_placed() -> None:
    rng = seeded(2)
    layout = {3: (0.03, [0.0, 0.0, 0.0]), 5: (0.03, [0.11, 0.06, 0.7]), 9: (0.02, [-0.09, 0.1, -1.2])}
    eyes = [camera((x, -0.4, 0.35)) for x in np.linspace(-0.1, 0.1, 12)]
    views = [
        {n: seen(on_floor(edge, np.array(place)), eye, rng) for n, (edge, place) in layout.items()}
        for eye in eyes
    ]
    room = solved_room(views, {n: FloorTag(edge) for n, (edge, _) in layout.items()}, LENS.size)
    assert room.camera is None
    for number, (_, place) in layout.items():
        assert room.floor[number].place == pytest.approx(place, abs=3e-3)
    assert room.sizes == pytest.approx(dict.fromkeys(layout, 1.0), abs=0.01)


def test_an_angle_is_not_guessed_where_another_one_explains_the_poses_as_well(
    arcfold: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A little bent, an arch is as short one way as the other."""
    robot = robot_of(arcfold)
    middle = np.full(12, 0.17)
    found = tracked(arcfold, frames_of(robot, poses(robot, middle), [camera()] * 12, 0.01), monkeypatch)
    assert "joint.mid_left" not in found.signals
    middle = np.linspace(0.6, 0.08, 24)
    found = tracked(arcfold, frames_of(robot, poses(robot, middle), [camera()] * 24, 0.01), monkeypatch)
    known = np.isfinite(found.signals["joint.mid_left"])
    assert found.signals["joint.mid_left"][known] == pytest.approx(middle[known], abs=0.03)


@pytest.mark.parametrize("held", [False, True])
def test_signals_are_right_and_their_noise_is_stated(
    held: bool, arcfold: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = robot_of(arcfold)
    middle = np.linspace(0.6, 1.5, 60)
    where = poses(robot, middle)
    shake = 2e-3 * np.cumsum(seeded(3).standard_normal((60, 3)), axis=0) * held
    frames = frames_of(robot, where, [camera(tuple(np.array(STAND.place) + move)) for move in shake])
    found = tracked(arcfold, frames, monkeypatch)
    assert (found.room.camera is None) is held
    assert list(found.signals)[:3] == ["marker.x", "marker.y", "marker.z"]
    known = np.isfinite(found.signals["joint.mid_left"])
    assert known.mean() > 0.9
    assert found.signals["joint.mid_left"][known] == pytest.approx(middle[known], abs=0.03)
    base, tail = robot.bodies
    assert tail.marker is not None
    marker = np.array([pose.of(tail.marker) for _, pose in where])
    truth = {f"marker.{axis}": marker[:, i] for i, axis in enumerate("xyz")}
    truth |= {
        f"site.{base.site}.{a}": np.array([one.shift[i] for one, _ in where]) for i, a in enumerate("xyz")
    }
    truth["joint.mid_left"] = middle
    for name, series in truth.items():
        away = found.signals[name] - series
        spread = float(np.nanstd(away))
        assert 1 / 1.5 < spread / found.noise[name] < 1.5, name
        assert spread < (0.02 if name.startswith("joint") else 1e-3), name
    assert found.noise["marker.x"] < 3e-4


def test_a_hidden_tag_leaves_a_gap_and_no_guess(arcfold: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_of(arcfold)
    frames = frames_of(robot, poses(robot, np.linspace(0.6, 1.5, 40)), [camera()] * 40)
    for frame in frames[10:20]:
        del frame[1]
    found = tracked(arcfold, frames, monkeypatch)
    assert np.flatnonzero(np.isnan(found.signals["marker.x"])).tolist() == list(range(10, 20))
    assert np.isnan(found.signals["joint.mid_left"][10:20]).all()
    assert np.isfinite(found.signals["joint.mid_left"]).sum() > 25
    assert np.isfinite(found.signals["site.base_tag.x"]).all()
    assert found.shares[1] == 0.75


def test_a_tag_that_is_found_wrongly_is_left_out_and_named(
    arcfold: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = robot_of(arcfold)
    frames = frames_of(robot, poses(robot, np.linspace(0.6, 1.5, 40)), [camera()] * 40)
    frames[7][0][2] += [6.0, -5.0]
    found = tracked(arcfold, frames, monkeypatch)
    assert np.flatnonzero(np.isnan(found.signals["site.base_tag.x"])).tolist() == [7]
    (defect,) = [defect for defect in found.defects if defect.name == "tag_outliers"]
    assert defect.spans_s == ((7 / 30, 7 / 30),)
    assert defect.message == "base_tag: 1 picture with a pose that does not fit its tags: left out"


def test_an_angle_is_a_gap_where_it_moves_nothing(arcfold: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_of(arcfold)
    middle = np.concatenate([np.zeros(20), np.full(20, 1.2)])
    found = tracked(arcfold, frames_of(robot, poses(robot, middle), [camera()] * 40), monkeypatch)
    assert np.isnan(found.signals["joint.mid_left"][:20]).all()
    assert found.signals["joint.mid_left"][20:] == pytest.approx(middle[20:], abs=0.03)


def test_tags_that_are_not_at_their_sites_are_named(
    arcfold: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = robot_of(arcfold)
    where = [
        [one, Pose(other.turn, other.shift + np.array([0.0, 0.02, 0.01]))]
        for one, other in poses(robot, np.linspace(0.6, 1.5, 40))
    ]
    found = tracked(arcfold, frames_of(robot, where, [camera()] * 40), monkeypatch)
    assert any(defect.name == "tags_misplaced" for defect in found.defects)


def test_films_that_cannot_be_used_are_one_line(arcfold: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_of(arcfold)
    frames = frames_of(robot, poses(robot, np.linspace(0.6, 1.5, 20)), [camera()] * 20)
    floor = [{n: c for n, c in frame.items() if n >= 100} for frame in frames]
    with pytest.raises(GaitoptError, match=r"^walk\.mp4: no tag of the robot is seen; looked for 0, 1$"):
        tracked(arcfold, floor, monkeypatch)
    tags = [{n: c for n, c in frame.items() if n < 100} for frame in frames]
    said = r"^walk\.mp4: the floor is not in view: none of its tags 100, 101, 102, 103, 104, 105 is seen$"
    with pytest.raises(GaitoptError, match=said):
        tracked(arcfold, tags, monkeypatch)


def test_a_tag_of_another_size_on_the_floor_is_one_line(
    arcfold: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = robot_of(arcfold)
    frames = frames_of(robot, poses(robot, np.linspace(0.6, 1.5, 20)), [camera()] * 20)
    rng = seeded(5)
    for frame in frames:
        frame[7] = seen(on_floor(0.027, np.array([0.0, 0.1, 0.2])), camera(), rng)
    file = arcfold.file.model_copy(update={"tags": arcfold.file.tags | {"7": Tag(size_mm=30.0)}})
    wrong = replace(arcfold, file=file)
    with pytest.raises(
        GaitoptError, match=r"tag 7: found 27\.0 mm on the floor, by the other tags, where 30 mm"
    ):
        tracked(wrong, frames, monkeypatch)


def test_of_the_two_poses_of_a_flat_tag_the_right_one_is_taken(arcfold: Problem) -> None:
    robot = robot_of(arcfold)
    where = poses(robot, np.linspace(0.6, 1.5, 30))
    eyes = [camera((0.1, -0.8, 0.2))] * 30
    frames = frames_of(robot, where, eyes, noise=0.1)
    room = solved_room(frames, sheet(), LENS.size)
    body = robot.bodies[0]
    path = paths.path_of(body, frames, paths.cameras_of(frames, room), room)
    for pose, (true, _) in zip(path.poses, where, strict=True):
        assert pose is not None
        assert np.arccos(0.5 * (np.trace(pose.turn.T @ true.turn) - 1.0)) < np.radians(8.0)


def test_a_robot_without_tags_is_one_line(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"no tag sits on the robot; say where: \[tags\.0\] with site"):
        Tracker.of(strider, {})
