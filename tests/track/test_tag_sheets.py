"""Sheets of tags: sizes on paper are exact, and what is printed is found again."""

import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from helpers import problem_folder
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Rectangle
from pictures import needs_opengl

from gaitopt.core.errors import GaitoptError
from gaitopt.jobs.tags import tag_numbers, tags
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.film.phone import Phone, Studio
from gaitopt.report.film.stage import Stand, stage_of
from gaitopt.report.film.tag_places import tag_places
from gaitopt.report.tag_sheets import PAPERS_MM, PrintedTag, tag_sheets
from gaitopt.track.floor_sheet import SHEET_MM, SHEET_TAG_MM
from gaitopt.track.opencv import opencv

MM = 72.0 / 25.4
"""Points of a PDF in a millimetre."""


def streams(path: Path) -> list[str]:
    """The drawing orders of each page of a PDF."""
    found = re.findall(rb"/Length \d+ 0 R.*?stream\r?\n(.*?)\r?\nendstream", path.read_bytes(), flags=re.S)
    texts = []
    for data in found:
        try:
            texts.append(zlib.decompress(data).decode("latin-1"))
        except zlib.error:
            continue
    return [text for text in texts if " re" in text or " l\n" in text]


def edges_mm(orders: str) -> list[float]:
    """Width of each filled shape on a page, mm."""
    widths = []
    for shape in re.findall(r"((?:-?[\d.]+ -?[\d.]+ [ml]\n|h\n|\n)+)f\n", orders):
        points = np.array(re.findall(r"(-?[\d.]+) (-?[\d.]+) [ml]", shape), dtype=float)
        widths.append(float(np.ptp(points[:, 0])) / MM)
    return widths


@pytest.mark.parametrize("paper", PAPERS_MM)
def test_the_pages_and_the_tags_have_exactly_their_sizes(paper: str, tmp_path: Path) -> None:
    made = tags(tmp_path / "tags.pdf", ids="3,5", size_mm=17.0, paper=paper)
    boxes = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", made.path.read_bytes())
    portrait, landscape = (np.array(box, dtype=float) / MM for box in boxes)
    assert portrait == pytest.approx(PAPERS_MM[paper], abs=0.01)
    assert landscape == pytest.approx(PAPERS_MM[paper][::-1], abs=0.01)
    cutting, floor = (edges_mm(orders) for orders in streams(made.path))
    assert sum(abs(edge - 17.0) < 1e-3 for edge in cutting) == 2
    assert sum(abs(edge - SHEET_TAG_MM) < 1e-3 for edge in floor) == len(SHEET_MM)


def test_printed_tags_are_found_at_their_places() -> None:
    figure = tag_sheets([], "a4")[-1]
    figure.set_dpi(127.0)  # 5 pixels a millimetre
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[..., 0].copy()
    aruco = opencv().aruco
    family = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11)
    found, numbers, _ = aruco.ArucoDetector(family).detectMarkers(picture)
    middles = dict(
        zip(np.ravel(numbers).tolist(), np.reshape(found, (-1, 4, 2)).mean(axis=1) / 5.0, strict=True)
    )
    assert set(middles) == set(SHEET_MM)
    wide, high = PAPERS_MM["a4"][::-1]
    for number, (along, left) in SHEET_MM.items():
        assert middles[number] == pytest.approx((wide / 2 + along, high / 2 - left), abs=0.2)


def test_the_same_tags_give_the_same_file(tmp_path: Path) -> None:
    for name in ("one.pdf", "other.pdf"):
        tags(tmp_path / name, ids="0-2")
    assert (tmp_path / "one.pdf").read_bytes() == (tmp_path / "other.pdf").read_bytes()


def test_a_problem_says_sizes_and_sites_of_its_tags(arcfold: Problem, tmp_path: Path) -> None:
    made = tags(tmp_path / "tags.pdf", problem=arcfold)
    assert made.tags == {0: 20.0, 1: 20.0}
    assert made.pages == (2 if made.note else 3)


@needs_opengl
def test_the_picture_shows_each_tag_on_the_robot(arcfold: Problem, tmp_path: Path) -> None:
    assert tags(tmp_path / "tags.pdf", problem=arcfold).note == ""
    (picture,) = tag_places(arcfold)
    assert picture.size == (960, 640)
    studio = Studio(stage_of(arcfold), Phone(size=(960, 640), focal=1400.0))
    still = studio.still(build_model(arcfold).key_qpos[0], Stand((-0.1, -0.4, 0.35), (0.08, 0.0, 0.02)))
    studio.close()
    aruco = opencv().aruco
    family = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11)
    _, numbers, _ = aruco.ArucoDetector(family).detectMarkers(still)
    assert {0, 1} <= set(np.ravel(numbers).tolist())


@needs_opengl
def test_tags_on_two_sides_take_two_pictures(arcfold: Problem) -> None:
    folder = problem_folder(Path("sides"), arcfold.source.parent)
    path = folder / arcfold.model_path.name
    text = path.read_text()
    begin = text.index('<site name="tail_tag"')
    end = text.index("/>", begin)
    left = '<site name="tail_tag" pos="0.025 0.0147 0.0229" euler="-1.047 0 0" size="0.003"'
    path.write_text(text[:begin] + left + text[end:])
    assert len(tag_places(load_problem(str(folder)))) == 2


def test_many_tags_take_several_pages_and_none_overlap() -> None:
    pages = tag_sheets([PrintedTag(n, 40.0) for n in range(40)], "letter")
    assert len(pages) > 2
    for page in pages[:-1]:
        boxes = [p.get_window_extent() for p in page.axes[0].patches if isinstance(p, Rectangle)]
        assert boxes
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_numbers_of_tags_are_lists_and_ranges() -> None:
    assert tag_numbers("0-3,7") == [0, 1, 2, 3, 7]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("3-1", "--ids: found '3-1'; allowed: the smaller number first"),
        ("a", "--ids: found 'a'; allowed: numbers such as 0-7 or 0,1,4-6"),
        ("1,1", "--ids: found '1,1'; allowed: each number once, 200 at most"),
        ("587", "--ids: found '587'; allowed: a number from 0 to 586, but not 100 to 105, which are the"),
        ("99-101", "--ids: found '101'; allowed: a number from 0 to 586, but not 100 to 105, which are the"),
    ],
)
def test_wrong_numbers_are_one_line(text: str, said: str) -> None:
    with pytest.raises(GaitoptError, match=f"^{re.escape(said)}"):
        tag_numbers(text)


def test_a_sheet_that_cannot_be_printed_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match=r"found no PDF; allowed: a file that ends in \.pdf$"):
        tags(tmp_path / "tags.png")
    with pytest.raises(GaitoptError, match=r"--size-mm: found 500\.0; allowed: 5 to 150$"):
        tags(tmp_path / "tags.pdf", size_mm=500.0)
    with pytest.raises(GaitoptError, match="--paper: found 'a3'; allowed: a4, letter"):
        tags(tmp_path / "tags.pdf", paper="a3")


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"x": {}}, "tags: found 'x'; allowed: a number from 0 to 586, but not 100 to 105"),
        ({"103": {}}, "tags: found '103'; allowed: a number from 0 to 586"),
        (
            {"2": {"site": "tail_tog"}},
            "unknown site in tags.2.site: 'tail_tog'; known: .*nearest: 'tail_tag'",
        ),
        ({"2": {"size_mm": 2.0}}, "tags.2.size_mm: found 2.0; allowed: greater than or equal to 5"),
        ({"2": {"sise_mm": 20}}, "tags.2.sise_mm: unknown key; allowed: site, size_mm .nearest: 'size_mm'"),
        (
            {"2": {"site": "a"}, "3": {"site": "a"}},
            "tags: found the site 'a' twice; allowed: one tag on each",
        ),
    ],
)
def test_a_wrong_tag_in_a_problem_is_one_line(
    table: dict, said: str, arcfold: Problem, tmp_path: Path
) -> None:  # type: ignore[type-arg]
    folder = problem_folder(tmp_path / "p", arcfold.source.parent, lambda content: content.update(tags=table))
    with pytest.raises(GaitoptError, match=said):
        build_model(load_problem(folder))
