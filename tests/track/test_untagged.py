"""Films without tags: a coloured dot or a patch is followed; what is not sure is a gap."""

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import seeded
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.problem import Problem
from gaitopt.track.film import pictures
from gaitopt.track.follow import Dot, Patch, PatchFollower
from gaitopt.track.sync import LampMark
from gaitopt.track.untagged import Length, PointTracker, track_point

Array = NDArray[np.float64]

pytestmark = pytest.mark.slow

FPS, COUNT, SIZE = 30, 60, (480, 270)
TIMES = np.arange(COUNT) / FPS
RULER = Length((100.0, 250.0), (300.0, 250.0), 100.0)
"""Half a millimetre a pixel."""


def path(t: Array | float) -> Array:
    """Where the point is, pixels, shape (..., 2)."""
    t = np.asarray(t)
    return np.stack([120.0 + 90.0 * t + 8.0 * np.sin(9.0 * t), 150.0 - 25.0 * np.sin(5.0 * t) ** 2], axis=-1)


def background() -> NDArray[np.float32]:
    rough = cv2.GaussianBlur(seeded(3).standard_normal((SIZE[1], SIZE[0])), (0, 0), 6.0)
    return np.repeat((110.0 + 150.0 * rough)[..., None], 3, axis=2).astype(np.float32)


def film(file: Path, draw: Callable[[NDArray[np.float32], int, Array], None]) -> Path:
    """A film; `draw` changes a picture of four times its size, by its number and where the point is."""
    rng = seeded(6)
    with av.open(str(file), "w") as container:
        stream = container.add_stream("libx264", rate=FPS, options={"crf": "18"})
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv444p"
        for index, at in enumerate(path(TIMES)):
            large = cv2.resize(background(), (4 * SIZE[0], 4 * SIZE[1]))
            draw(large, index, 4.0 * at + 1.5)
            small = cv2.GaussianBlur(cv2.resize(large, SIZE, interpolation=cv2.INTER_AREA), (0, 0), 0.7)
            noisy = np.clip(small + 2.0 * rng.standard_normal(small.shape), 0, 255).astype(np.uint8)
            frame = av.VideoFrame.from_ndarray(noisy, format="rgb24")
            frame.pts, frame.time_base = index, Fraction(1, FPS)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return file


def disc(picture: NDArray[np.float32], place: Array, colour: tuple[int, int, int], radius: int = 24) -> None:
    x, y = (16.0 * place).round().astype(int).tolist()
    cv2.circle(picture, (x, y), 16 * radius, colour, -1, cv2.LINE_AA, 4)


def red_dot(picture: NDArray[np.float32], index: int, place: Array) -> None:
    """A red dot: hidden in pictures 20 to 24, half hidden in 30 to 32; it has a twin in 40 to 42."""
    if not 20 <= index < 25:
        disc(picture, place, (210, 30, 40))
    if 30 <= index < 33:
        x, y = place.round().astype(int)
        picture[y - 40 : y + 40, x : x + 40] = 90.0
    if 40 <= index < 43:
        disc(picture, place + np.array([90.0, 10.0]), (210, 30, 40))
    if index >= 12:
        disc(picture, np.array([1600.0, 200.0]), (255, 255, 200), 14)  # a lamp


def truth() -> dict[str, Array]:
    moved = 0.5e-3 * (path(TIMES) - path(0.0))
    return {"marker.x": moved[:, 0], "marker.z": -moved[:, 1]}


@pytest.fixture(scope="module")
def dotted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return film(tmp_path_factory.mktemp("dot") / "dot.mp4", red_dot)


def errors(found: dict[str, Array]) -> dict[str, float]:
    away = {name: series - truth()[name] for name, series in found.items()}
    return {name: float(np.nanstd(series)) for name, series in away.items()}


def test_a_dot_is_followed_and_what_is_not_sure_is_a_gap(dotted: Path) -> None:
    x, y = path(0.0)
    found = track_point(dotted, PointTracker(Dot(x, y), RULER), beginning=LampMark(400.0, 50.0))
    gaps = np.flatnonzero(~np.isfinite(found.places[:, 0]))
    assert set(gaps) == {*range(20, 25), *range(30, 33), *range(40, 43)}
    for name, error in errors(dict(found.signals)).items():
        assert error < 0.06e-3, name
        assert 0.5 < found.noise[name] / error < 2.0
    assert found.sync.at_s == pytest.approx(11.5 / FPS)


def test_a_dot_with_a_twin_at_first_is_followed_from_where_it_is_alone(tmp_path: Path) -> None:
    """Nothing is measured from the first picture, in which its place is not sure."""

    def late(picture: NDArray[np.float32], index: int, place: Array) -> None:
        disc(picture, place, (210, 30, 40))
        if not index:
            disc(picture, place + np.array([90.0, 10.0]), (210, 30, 40))

    made, (x, y) = film(tmp_path / "late.mp4", late), path(0.0)
    found = track_point(made, PointTracker(Dot(x, y), RULER))
    assert np.isfinite(found.signals["marker.x"]).sum() > 50


def stamped(picture: NDArray[np.float32], index: int, place: Array) -> None:
    """A block with a pattern, which turns; it is covered from picture 20 to 24."""
    rng = seeded(9)
    pattern = cv2.resize(rng.uniform(20.0, 230.0, (6, 9)), (144, 96), interpolation=cv2.INTER_NEAREST)
    angle = 12.0 * np.sin(index / 8.0)
    turn = cv2.getRotationMatrix2D((71.5, 47.5), angle, 1.0)
    turn[:, 2] += place - np.array([71.5, 47.5])
    wide = picture.shape[1], picture.shape[0]
    mask = cv2.warpAffine(np.ones_like(pattern), turn, wide)[..., None]
    shown = cv2.warpAffine(pattern, turn, wide)[..., None]
    picture[:] = (1.0 - mask) * picture + mask * shown
    if 20 <= index < 25:
        x, y = place.round().astype(int)
        picture[y - 60 : y + 60, x - 80 : x + 80] = 120.0


def test_a_patch_is_followed_as_it_turns(tmp_path: Path) -> None:
    made = film(tmp_path / "patch.mp4", stamped)
    x, y = path(0.0)
    found = track_point(made, PointTracker(Patch(x - 17.5, y - 11.5, 36.0, 24.0), RULER))
    gaps = np.flatnonzero(~np.isfinite(found.places[:, 0]))
    assert set(range(20, 25)) <= set(gaps)
    assert len(gaps) <= 10
    for name, error in errors(dict(found.signals)).items():
        assert error < 0.06e-3, name
        assert 0.4 < found.noise[name] / error < 2.5


def test_a_length_says_scale_and_direction() -> None:
    leftward = Length((300.0, 100.0), (100.0, 100.0), 50.0)
    assert leftward.m_per_px == pytest.approx(0.25e-3)
    assert leftward.axes("side") == pytest.approx(np.array([[-1.0, 0.0], [0.0, -1.0]]))
    assert leftward.axes("top") == pytest.approx(np.array([[-1.0, 0.0], [0.0, 1.0]]))
    assert RULER.axes("top") == pytest.approx(np.array([[1.0, 0.0], [0.0, -1.0]]))


def test_a_film_without_tags_becomes_a_trial(
    dotted: Path, arcfold: Problem, tmp_path: Path, capsys: Any
) -> None:
    x, y = path(0.0)
    given = ["track", str(dotted), "--problem", "arcfold", "--gait", "square-0.5s", "--json", "--quiet"]
    out = ["--out", str(tmp_path / "set"), "--report", str(tmp_path / "page")]
    about = ["--dot", f"{x},{y}", "--length", "100,250,300,250,100", "--sync-led", "400,50"]
    assert cli.main([*given, *out, *about]) == 0
    (trial,) = json.loads(capsys.readouterr().out)["trials"]
    assert trial["m_per_px"] == pytest.approx(0.5e-3)
    (read,) = load_dataset(tmp_path / "set", arcfold, measurable_signals(arcfold)).trials
    assert list(read.signals) == ["marker.x", "marker.z"]
    assert read.starts_at_s == pytest.approx(-11.5 / FPS)
    html = (tmp_path / "page" / "report.html").read_text()
    assert "without tags" in html
    assert "Not drawn" not in html
    assert len(list(pictures(tmp_path / "page" / "overlays" / "dot.mp4"))) == COUNT


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (
            ["--dot", "10,10", "--length", "1,1,200,1,50"],
            "--dot: found grey at 10,10; allowed: a coloured dot",
        ),
        (["--dot", "900,10", "--length", "1,1,200,1,50"], "--dot: found 900,10; allowed: inside 480 by 270"),
        (
            ["--patch", "5,5,6,6", "--length", "1,1,200,1,50"],
            "--patch: found 6 by 6 pixels; allowed: 12 or more",
        ),
        (["--dot", "10,10", "--length", "1,1,2,1,50"], "--length: found '50 mm over 1 pixels'"),
        (["--dot", "10,10"], "found 1 of --dot and --patch, and 0 of --length; allowed: both"),
        (["--dot", "10,10", "--length", "1,1,200,1,50", "--view", "front"], "--view: found 'front'"),
        (
            ["--dot", "1,1", "--length", "1,1,99,1,50", "--sync-tag", "3"],
            "--sync-tag: found in a film without",
        ),
    ],
)
def test_a_wrong_point_is_one_line(more: list[str], said: str, dotted: Path, capsys: Any) -> None:
    given = ["track", str(dotted), "--problem", "arcfold", "--gait", "square-0.5s", "--out", "set"]
    assert cli.main([*given, *more]) == 1
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not Path("set").exists()


def test_a_plain_patch_is_not_followed() -> None:
    flat = np.full((40, 40), 90, np.uint8)
    with pytest.raises(GaitoptError, match="found plain, contrast 0"):
        PatchFollower(Patch(5.0, 5.0, 20.0, 20.0), flat)
