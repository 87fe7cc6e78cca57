"""Pages and figures: what they say, and that they need nothing else."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER
from matplotlib import pyplot as plt
from pictures import needs_opengl

from gaitopt.cli import app as cli
from gaitopt.cli.completion import SHELLS, completion_script
from gaitopt.cli.display import _time_left
from gaitopt.core.errors import GaitoptError
from gaitopt.core.quantities import figure, label_of, shown, title_of
from gaitopt.optimise.compare import ComparedGait, paired_ratio
from gaitopt.optimise.sensitivity import Sensitivity
from gaitopt.optimise.study import Progress
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.report.figures import comparison as comparison_figures
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.figures import search as search_figures
from gaitopt.report.page import typeset
from gaitopt.simulation.rollout import Simulator


def page_of(folder: Path, names: set[str]) -> str:
    """The page of a folder, once it is seen to be whole."""
    page = (folder / "report.html").read_text()
    assert {path.stem for path in (folder / "figures").iterdir()} == names
    assert page.count("<figure>") == page.count("data:image/") == page.count("<figcaption>") == len(names)
    links = set(re.findall(r'(?:src|href)="(?!data:)(.*?)"', page))
    anchors = re.findall(r'<section id="(.*?)">', page)
    assert links == {f"#{anchor}" for anchor in anchors}
    assert len(anchors) == len(set(anchors)) == page.count("<section")
    assert "<script" not in page
    words = re.sub(r'"data:.*?"', "", page.partition("</style>")[2])
    assert not re.search(r"\d%|\bnan\b|\binf\b|\d{5}\.\d|\d\.\d{5}", words)
    return page


def test_compare_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", str(STRIDER), "stride", "square", "--out", str(tmp_path / "c")]) == 0
    out = capsys.readouterr().out
    page = page_of(tmp_path / "c", {"speeds", "differences", "position"})
    (said,) = re.findall(r"square .* than noise.*\.", out)
    assert re.fullmatch(r"square (is (faster|slower) than|differs from) stride .*90 % interval .*", said)
    assert str(typeset(said)) in page
    assert f"report: {tmp_path / 'c' / 'report.html'}" in out.replace("\n", "").replace(
        "report:", "\nreport:"
    )


def test_check_writes_a_page(tmp_path: Path) -> None:
    assert cli.main(["check", str(STRIDER), "--out", str(tmp_path / "c"), "--json"]) == 0
    page = page_of(tmp_path / "c", {"findings", "position", "height"})
    assert "what to do" in page
    assert (tmp_path / "c" / "check.json").is_file()


def test_a_used_folder_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("mine")
    for command in (["compare", str(STRIDER), "stride"], ["check", str(STRIDER)]):
        assert cli.main([*command, "--out", str(tmp_path)]) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["notes"]


@needs_opengl
def test_a_full_report_has_a_film_and_sensitivities(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert (
        cli.main(["optimise", str(STRIDER), "--budget", "4", "--full", "--out", str(folder), "--quiet"]) == 0
    )
    names = {"speeds", "position", "periods", "gait", "angles", "convergence", "walk"}
    names |= {"sensitivity", "sensitivity-model"}
    page = page_of(folder, names)
    assert "data:image/webp" in page
    rows = json.loads((folder / "sensitivity.json").read_text())["rows"]
    assert {row["kind"] for row in rows} == {"gait", "model"}
    assert "gaitopt export" in page


def test_a_ratio_has_an_interval_where_the_first_gait_goes_forward(strider: Problem) -> None:
    assert paired_ratio(np.array([2.0, 4.1, 6.0]), np.array([-1.0, 2.0, 0.5])) is None
    ratio = paired_ratio(np.array([2.0, 4.1, 6.0]), np.array([1.0, 2.0, 3.0]))
    assert ratio is not None
    assert ratio.value == pytest.approx(12.1 / 6.0)
    assert ratio.ci90[0] < ratio.value < ratio.ci90[1] < 2.2
    assert np.mean(ratio.ci90) == pytest.approx(ratio.value)


def test_a_person_reads_units() -> None:
    assert (label_of("speed_m_s"), shown("speed_m_s", 0.0716)) == ("forward speed [mm/s]", "71.6")
    assert (label_of("yaw_rate_rad_s"), shown("yaw_rate_rad_s", 1.0)) == ("turning rate [°/s]", "57.3")
    assert (label_of("reached.foot1"), shown("reached.foot1", 0.866)) == ("travel reached, foot1 [%]", "86.6")
    assert [title_of(name) for name in ("stride_m", "unrest_at_start")] == ["stride", "unrest at start"]
    assert [figure(v) for v in (math.nan, math.inf, 4.0, 1234.5, 2e7, 1e-6)] == [
        "–", "∞", "4", "1234", "2.0e+07", "1.0e-06",
    ]  # fmt: skip
    assert shown("violations", {"tilt_rad": 1.0}) == "largest tilt"
    assert (shown("x", None), shown("x", True), shown("x_m", [0.1, 0.2])) == ("–", "yes", "100 to 200")


def test_a_page_keeps_figures_and_units_together() -> None:
    assert typeset("5% of -3 mm < 2 N m") == "5\u00a0% of −3\u00a0mm &lt; 2\u00a0N\u00a0m"
    assert typeset("square-1s.") == '<span class="whole">square-1s</span>.'
    assert typeset("--budget 30 -v") == "--budget 30 -v"


def test_forward_is_the_problems_own(strider: Problem) -> None:
    trajectory = Simulator.build(strider).run(strider.baselines["stride"])
    moved = trajectory["marker.y"] - trajectory["marker.y"][0]
    np.testing.assert_allclose(gait_figures.along(trajectory, strider.roles, 0), moved, atol=1e-12)
    line = gait_figures.overlay({"stride": trajectory}, strider.roles).axes[0].lines[0]
    assert np.max(np.abs(line.get_ydata())) == pytest.approx(1e3 * np.abs(moved).max(), rel=1e-3)


def test_every_axis_has_a_unit(strider: Problem) -> None:
    simulator, gait = Simulator.build(strider), strider.baselines["stride"]
    robot, trajectory = Robot.of(simulator.models[0]), simulator.run(gait)
    row = ComparedGait(
        name="a", period_s=1.0, speed_ci90_m_s=(0.009, 0.011), speed_worst_m_s=0.008, difference_m_s=0.0,
        difference_ci90_m_s=(0.0, 0.0), ratio=None, ratio_ci90=None, more_than_noise=False,
        constraints_met=True, violations={}, status="ok", scenario_speeds_m_s=(0.008, 0.012),
        metrics={"speed_m_s": 0.01},
    )  # fmt: skip
    figures = [
        gait_figures.overlay({"a": trajectory}, strider.roles),
        gait_figures.panels({"a": trajectory, "b": trajectory}, strider.roles),
        gait_figures.gait_diagram(strider, gait, trajectory, robot),
        gait_figures.angles(strider, gait, trajectory, robot),
        comparison_figures.speeds([row]),
        comparison_figures.differences([row, row]),
        gait_figures.commanded(gait),
        search_figures.sensitivity(
            [Sensitivity("x", "gait", 0.001, -0.002, -0.0015, 0.001)], "5 % of its range"
        ),
    ]
    for drawn in figures:
        labels = [axes.get_xlabel() for axes in drawn.axes] + [axes.get_ylabel() for axes in drawn.axes]
        said = [label for label in labels if label]
        assert any(label.endswith("]") or label.startswith("share") for label in said)
        assert all(label.endswith("]") or label.startswith("share") for label in said)
    assert plt.get_fignums() == []


def test_a_pad_holds_slides_or_slips(strider: Problem) -> None:
    simulator, gait = Simulator.build(strider), strider.baselines["stride"]
    robot, trajectory = Robot.of(simulator.models[0]), simulator.run(gait)
    for pad in strider.roles.pads:
        states = gait_figures.pad_states(strider, trajectory, pad, robot)
        assert states.sum(axis=0).max() == 1
        assert states.any()


def test_time_left_is_at_the_pace_since_the_search_began_or_resumed() -> None:
    assert _time_left(Progress(30, 90, "cma-es", None, 0.0), 10, 5.0) == ", about 15 s left"
    assert _time_left(Progress(10, 90, "cma-es", None, 0.0), 10, 5.0) == ""
    assert _time_left(Progress(90, 90, "cma-es", None, 0.0), 10, 5.0) == ""


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_knows_every_command(shell: str) -> None:
    script = completion_script(cli.build_parser(), shell)
    assert all(name in script for name in ("optimise", "simulate", "export", "budget", "video", "score"))


def test_completion_of_an_unknown_shell() -> None:
    with pytest.raises(GaitoptError, match="bash, zsh, fish"):
        completion_script(cli.build_parser(), "csh")
