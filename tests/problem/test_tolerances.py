"""Tolerances: the table of a problem file, and the keys that older files have elsewhere."""

import math
import re
from pathlib import Path

import pytest

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.tolerances import Tolerances

ROOT = Path(__file__).resolve().parents[2]


def with_table(tmp_path: Path, tolerances: str, scenarios: str = "") -> Problem:
    """The bench's servo, with a table of tolerances and more in its scenarios."""
    text = (ROOT / "problems" / "servo-bench" / "problem.toml").read_text(encoding="utf-8")
    bench = text[: text.index("[tolerances]")]
    (tmp_path / "servo-bench.xml").write_bytes((ROOT / "problems/servo-bench/servo-bench.xml").read_bytes())
    file = tmp_path / "problem.toml"
    file.write_text(f"{bench}\n[scenarios]\n{scenarios}\n{tolerances}\n", encoding="utf-8")
    return load_problem(file)


def test_a_tolerance_that_is_not_given_has_its_default(tmp_path: Path) -> None:
    found = with_table(tmp_path, "[tolerances]\nslope_deg = 1.0").file.tolerances
    assert found == Tolerances().model_copy(update={"slope_deg": 1.0})


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("slope = 1.0", r"tolerances\.slope: unknown key; allowed: .*\(nearest: 'slope_deg'\)"),
        ("friction = -0.1", r"tolerances\.friction: found -0\.1; allowed: greater than or equal to 0"),
        ("friction = 0.6", r"tolerances\.friction: found 0\.6; allowed: less than 0\.577"),
        ('friction = "0.1"', r"tolerances\.friction: found '0\.1'; allowed: a number"),
        ("clock_rate = nan", r"tolerances\.clock_rate: found nan; allowed: "),
    ],
)
def test_a_wrong_tolerance_is_one_clear_line(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(GaitoptError, match=message) as caught:
        with_table(tmp_path, f"[tolerances]\n{line}")
    assert "\n" not in str(caught.value)


def test_a_file_with_its_tolerances_in_scenarios_goes_on_working(tmp_path: Path) -> None:
    """There, most were half the width of a uniform draw."""
    lines = "friction = 0.15\nservo_strength = 0.1\nservo_trim_deg = 2\nstart_pose_rad = 0.005"
    found = with_table(tmp_path, "", lines).file.tolerances
    assert found.friction == pytest.approx(0.15 / math.sqrt(3.0))
    assert found.servo_strength == pytest.approx(0.1 / math.sqrt(3.0))
    assert found.servo_trim_deg == pytest.approx(2.0 / math.sqrt(3.0))
    assert found.start_pose_rad == 0.005
    assert found.hinge_stiffness_each == Tolerances().hinge_stiffness_each


def test_a_tolerance_is_given_in_one_place(tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match=r"scenarios\.friction: found 0\.2; allowed: .* \[tolerances\]"):
        with_table(tmp_path, "[tolerances]\nfriction = 0.1", "friction = 0.2")


def test_a_word_for_a_moved_tolerance_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match=r"scenarios\.friction: unknown key; allowed: search, verif"):
        with_table(tmp_path, "", 'friction = "much"')


def test_a_problem_that_is_written_keeps_its_tolerances(arcfold: Problem, tmp_path: Path) -> None:
    (tmp_path / "problem.toml").write_text(arcfold.to_toml("model.xml"), encoding="utf-8")
    (tmp_path / "model.xml").write_text("<mujoco/>", encoding="utf-8")
    assert load_problem(tmp_path).file.tolerances == arcfold.file.tolerances


def test_the_page_on_tolerances_lists_each_with_its_default() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| ([\d.]+) \|", (ROOT / "docs/tolerances.md").read_text("utf-8"), re.MULTILINE
    )
    assert {name: float(value) for name, value in rows} == Tolerances().model_dump()
