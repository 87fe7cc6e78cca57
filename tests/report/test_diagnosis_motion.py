"""The robot on the page of a diagnosis."""

import json
import re
from pathlib import Path

import numpy as np
import planting
import pytest
from benches import bench, located, write_bench
from helpers import STRIDER

from gaitopt.diagnose.correction import Correction
from gaitopt.problem.problem import load_problem
from gaitopt.report import settings
from gaitopt.report.diagnosis import write_page
from gaitopt.report.diagnosis_motion import motion_parts
from gaitopt.report.figures.way import Way, from_above


@pytest.fixture(autouse=True)
def small_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that are quick to draw."""
    monkeypatch.setattr(settings, "DEFAULT", settings.ReportSettings(dpi=40))


@pytest.mark.slow
def test_the_nominal_and_the_corrected_robot_walk_beside_the_measured_marker(tmp_path: Path) -> None:
    problem, late = load_problem(STRIDER), {"command_latency": {"delay_s": 0.03}}
    signals = ("marker.x", "marker.y", "marker.z")
    filmed = planting.recording_of(planting.rollout(problem, "stride", 3.0, late), signals=signals)
    diagnosis = located(problem, planting.dataset(tmp_path / "data", {"walk": ("stride", filmed)}))
    correction = Correction(problem.with_effects(late), ())
    write_page(tmp_path / "run", problem, diagnosis, correction)
    assert (tmp_path / "run/figures/way.png").exists()
    page = (tmp_path / "run/report.html").read_text()
    (content,) = re.findall(r'<script type="application/json">(.*?)</script>', page)
    played = json.loads(content)
    assert [take["name"] for take in played["takes"]] == ["stride, nominal", "stride, corrected"]
    assert [take["trial"] for take in played["takes"]] == ["walk", "walk"]
    assert len(played["robots"]) == 1
    ((_, picture),) = motion_parts(tmp_path, problem, diagnosis, correction, full=False).pictures
    labels = [str(line.get_label()) for line in picture.draw().axes[0].lines]
    assert sum(label.startswith("measured: ") for label in labels) == 1


def test_a_robot_without_a_marker_is_played_under_its_log(tmp_path: Path) -> None:
    arm = bench(tmp_path / "arm")
    diagnosis = located(arm, write_bench(tmp_path / "data", arm, lambda time, at: at(time)))
    parts = motion_parts(tmp_path, arm, diagnosis, None, full=False)
    assert (parts.notes, parts.pictures) == ((), ())
    assert [section.title for section in parts.sections] == ["The robot"]


def test_the_way_from_above_starts_at_zero_and_ends_where_the_legend_says() -> None:
    problem = load_problem(STRIDER)
    walked = planting.rollout(problem, "stride", 2.0)
    axes = from_above([Way("stride", walked)], problem.roles).axes[0]
    (line,) = [line for line in axes.lines if str(line.get_label()).startswith("stride: ")]
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert (x[0], y[0]) == (0.0, 0.0)
    forward = 1e3 * (walked["marker.y"][-1] - walked["marker.y"][0])
    assert x[-1] == pytest.approx(forward, abs=2.0)
    assert re.match(r"stride: -?\d+ mm forward, 0 mm (left|right)", str(line.get_label()))
    assert axes.get_aspect() == 1.0
