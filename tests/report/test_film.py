"""Films: what is shown, when, in which format, and the message if no film can be made."""

from dataclasses import replace
from pathlib import Path

import av
import mujoco
import numpy as np
import pytest
from pictures import needs_opengl
from PIL import Image
from planting import dataset, recording_of

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.problem.problem import Problem
from gaitopt.report.film.camera import camera_of
from gaitopt.report.film.film import film_length, frames, loop_rate, write_film
from gaitopt.report.film.ghost import trial_of
from gaitopt.report.film.gl import open_context
from gaitopt.report.film.section import FilmPart, film_on_page_s, film_part
from gaitopt.report.film.take import Take, take, take_beside
from gaitopt.report.settings import FilmSettings, ReportSettings
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

SMALL = FilmSettings(size=(160, 90), fps=10.0, loop_size=(80, 46), loop_rates=(10.0, 12.5, 20.0))
"""Films of few small pictures."""


@pytest.fixture(scope="module")
def takes(strider: Problem) -> list[Take]:
    simulator = Simulator.build(strider)
    return [take(simulator, gait, 1.0) for gait in strider.baselines.values()]


def test_poses_are_kept_when_asked_for_and_change_nothing(strider: Problem) -> None:
    simulator = Simulator.build(strider)
    gait = strider.baselines["stride"]
    plain, posed = simulator.run(gait), simulator.run(gait, poses=True)
    assert plain.poses is None
    assert posed.poses is not None
    assert posed.poses.shape == (len(posed.time), simulator.models[0].nq)
    assert all(np.array_equal(plain[name], posed[name]) for name in plain.signals)
    along = posed.poses[:, 0]  # the slide along y, a step after the marker that it carries
    moved = posed["marker.y"] - posed["marker.y"][0]
    np.testing.assert_allclose(along - along[0], moved, atol=0.01)


def test_a_film_lasts_whole_cycles(strider: Problem) -> None:
    gait = strider.baselines["stride"]
    assert film_length([gait]) == pytest.approx(5.0)
    assert film_length([gait, gait.with_period(4.0)]) == pytest.approx(8.0)
    assert film_length([gait.with_period(7.0)]) == pytest.approx(7.0)


@needs_opengl
def test_the_robot_is_in_the_picture_and_moves(takes: list[Take]) -> None:
    first, last = (
        np.asarray(picture, float) for picture in frames(takes[:1], np.array([0.0, 0.4]), (320, 180))
    )
    assert first.shape == (180, 320, 3)
    middle = first[60:120, 80:240]
    assert middle.std() > 10.0
    assert np.abs(first - last).mean() > 1.0


@needs_opengl
def test_two_robots_stand_side_by_side(takes: list[Take]) -> None:
    both = next(frames(takes, np.array([0.3]), (160, 90)))
    alone = [next(frames([shown], np.array([0.3]), (160, 90))) for shown in takes]
    assert both.size == (320, 90)
    halves = [both.crop((0, 0, 160, 90)), both.crop((160, 0, 320, 90))]
    assert all(np.array_equal(np.asarray(a), np.asarray(b)) for a, b in zip(halves, alone, strict=True))


@needs_opengl
def test_an_mp4_has_its_length_and_size(takes: list[Take], tmp_path: Path) -> None:
    write_film(tmp_path / "walk.mp4", takes[:1], end=0.4, settings=SMALL)
    with av.open(tmp_path / "walk.mp4") as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.average_rate) == ("h264", SMALL.fps)
        pictures = list(container.decode(stream))
    assert len(pictures) == round(0.4 * SMALL.fps)
    assert (pictures[0].width, pictures[0].height) == SMALL.size


@needs_opengl
@pytest.mark.parametrize("suffix", ["gif", "webp"])
def test_a_loop_plays_for_ever(takes: list[Take], tmp_path: Path, suffix: str) -> None:
    write_film(tmp_path / f"walk.{suffix}", takes, end=0.5, settings=SMALL)
    with Image.open(tmp_path / f"walk.{suffix}") as loop:
        assert loop.size == (2 * SMALL.loop_size[0], SMALL.loop_size[1])
        rate = loop_rate(takes, SMALL)
        assert loop.n_frames == round(0.5 * rate)
        loop.load()
        assert (loop.info["loop"], loop.info["duration"]) == (0, round(1000 / rate))


@needs_opengl
def test_the_command_films_and_answers(
    tmp_path: Path, strider: Problem, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, path = str(strider.source.parent), tmp_path / "walk.webp"
    options = ["--beside", "square", "--seconds", "0.3", "--video", str(path)]
    assert cli.main(["simulate", folder, "stride", *options]) == 0
    assert path.is_file()
    assert "forward speed" in capsys.readouterr().out


@pytest.fixture(scope="module")
def trials(strider: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the robot as simulated that begins within a cycle, and one of a joint alone."""
    simulator, folder = Simulator.build(strider), tmp_path_factory.mktemp("trials")
    moved = simulator.observe(simulator.run(strider.baselines["stride"], duration=4.0))
    seen = {"seen": ("marker.y",), "blind": ("joint.rear_hip",)}
    columns = {
        name: recording_of(moved, 0.2, noise_m=1e-5, signals=signals) for name, signals in seen.items()
    }
    dataset(folder / "seen", {"filmed": ("stride", columns["seen"])})
    dataset(folder / "blind", {"blind": ("stride", columns["blind"])})
    return folder


def test_the_ghost_of_the_robot_as_simulated_is_its_marker(strider: Problem, trials: Path) -> None:
    simulator = Simulator.build(strider)
    trial = trial_of(load_dataset(trials / "seen", strider, simulator.signals), strider.baselines["stride"])
    shown = take_beside(simulator, trial, 1.0)
    assert shown.ghost is not None
    marker = shown.trajectory.stacked("marker")
    there = np.stack([np.interp(shown.ghost.time, shown.trajectory.time, one) for one in marker.T], axis=1)
    np.testing.assert_allclose(shown.ghost.positions, there, atol=3e-4)
    at = float(shown.ghost.time[10])
    assert len(shown.ghost.before(at, 0.1)) == pytest.approx(0.1 * 30, abs=1)
    assert len(shown.ghost.before(-1.0, 0.5)) == len(shown.ghost.before(99.0, 0.5)) == 0


@needs_opengl
def test_the_measured_marker_is_drawn(strider: Problem, trials: Path) -> None:
    simulator = Simulator.build(strider)
    trial = trial_of(load_dataset(trials / "seen", strider, simulator.signals), strider.baselines["stride"])
    shown = take_beside(simulator, trial, 1.0)
    with_ghost, without = (
        np.asarray(next(frames([one], np.array([0.9]), (320, 180))), int)
        for one in (shown, replace(shown, ghost=None))
    )
    blue = (with_ghost[..., 2] > with_ghost[..., 0] + 80) & (without[..., 2] < without[..., 0] + 80)
    assert blue.sum() > 20


@pytest.mark.parametrize(
    ("gait", "data", "said"),
    [("square", "seen", "no trial of square"), ("stride", "blind", "no marker was measured")],
)
def test_no_ghost_is_one_line(
    strider: Problem, trials: Path, gait: str, data: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--video", "walk.mp4", "--measured", str(trials / data)]
    assert cli.main(["simulate", str(strider.source.parent), gait, *options]) == 1
    assert said in capsys.readouterr().err
    assert not Path("walk.mp4").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--video", "walk.avi"], "no film format; allowed: a file that ends in .mp4, .gif, .webp"),
        (["--video", "nowhere/walk.mp4"], "no folder nowhere"),
        (["--beside", "square"], "--beside: found no --video"),
        (["--measured", "trials"], "--measured: found no --video"),
        (["--seconds", "2"], "--seconds: found no --video"),
        (["--video", "walk.mp4", "--seconds", "-1"], "allowed: a positive number"),
        (["--view"], "--view: no screen here"),
    ],
)
def test_what_cannot_be_filmed_is_one_line(
    strider: Problem,
    options: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert cli.main(["simulate", str(strider.source.parent), "stride", *options]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(Path().iterdir())


def test_without_opengl_the_package_is_named(
    takes: list[Take], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "nonesuch")
    with pytest.raises(GaitoptError, match=r"apt install libegl1.*MUJOCO_GL is 'nonesuch'"):
        write_film(tmp_path / "walk.mp4", takes, end=0.1)
    assert not list(tmp_path.iterdir())


@needs_opengl
def test_a_back_end_that_fails_does_not_stop_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as wrong:
        wrong.setenv("MUJOCO_GL", "nonesuch")
        with pytest.raises(GaitoptError):
            open_context(8, 8)
    open_context(8, 8).free()


def test_a_page_says_why_it_has_no_film(tmp_path: Path) -> None:
    def write(path: Path) -> None:
        path.write_text("half a film")
        raise GaitoptError("no light")

    assert film_part(tmp_path, "walk", "Film", "Darkness.", write) == FilmPart(notes=("No film: no light",))
    assert not list((tmp_path / "figures").iterdir())


def test_a_film_on_a_page_shows_whole_cycles() -> None:
    settings = ReportSettings(film_s=3.0)
    assert [film_on_page_s(period, settings) for period in (0.5, 2.0, 4.0)] == [3.0, 4.0, 4.0]


def test_the_whole_robot_is_in_the_picture_and_no_obstacle_widens_it() -> None:
    """Of a robot that is wide across, near feet are far down: they are seen, with a ramp beside it too."""
    ramp = '<body pos="1 0 0"><geom type="box" size=".4 .4 .05"/></body>'
    foot = '<body pos="0 -.4 -.1"><joint name="j" axis="1 0 0"/><geom type="box" size=".02 .02 .1"/></body>'
    robot = f'<body pos="0 0 .2"><freejoint/><geom type="box" size=".12 .2 .03"/>{foot}</body>'
    settings = FilmSettings()

    def camera(world: str) -> tuple[Take, mujoco.MjvCamera]:
        text = f'<mujoco><worldbody>{world}</worldbody><actuator><position joint="j"/></actuator></mujoco>'
        model = mujoco.MjModel.from_xml_string(text)
        still = Trajectory(np.zeros(1), {}, "ok", poses=model.qpos0[None])
        shown = Take(model, still, np.eye(3), "still", None, 1.0, float("nan"))
        path = np.array([[0.0, -0.1, 0.1]])
        return shown, camera_of(shown, path, np.zeros(1), settings.size, settings)

    shown, alone = camera(robot)
    assert camera(robot + ramp)[1].distance == pytest.approx(alone.distance)
    data = mujoco.MjData(shown.model)
    mujoco.mj_kinematics(shown.model, data)
    corner = data.geom_xpos[1] - np.array([0.0, 0.02, 0.1])  # of the near foot, the lowest
    tip, turn = np.radians(alone.elevation), np.radians(alone.azimuth)
    ahead = np.array([np.cos(tip) * np.cos(turn), np.cos(tip) * np.sin(turn), np.sin(tip)])
    up = np.cross([np.sin(turn), -np.cos(turn), 0.0], ahead)
    seen = corner - np.array([0.0, -0.1, 0.1])
    slope = float(seen @ up) / (alone.distance + float(seen @ ahead))
    assert abs(slope) < np.tan(np.radians(settings.field_of_view_deg / 2.0))
