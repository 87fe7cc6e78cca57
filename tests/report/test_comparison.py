"""The report of a comparison."""

import re
from pathlib import Path

import pytest
from helpers import STRIDER
from pages import page_of

from gaitopt.cli import app as cli
from gaitopt.gait.gait import write_gait
from gaitopt.problem.problem import load_problem
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.page import typeset


def test_compare_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", str(STRIDER), "stride", "square", "--out", str(tmp_path / "c")]) == 0
    out = capsys.readouterr().out
    page = page_of(tmp_path / "c", {"speeds", "differences", "position", "way"})
    (said,) = re.findall(r"square .* than noise.*\.", out)
    assert re.fullmatch(r"square (is (faster|slower) than|differs from) stride .*90 % interval .*", said)
    assert str(typeset(said)) in page
    assert f"report: {tmp_path / 'c' / 'report.html'}" in out.replace("\n", "").replace(
        "report:", "\nreport:"
    )


def test_gaits_of_one_name_are_drawn_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of two run folders are, or of two gait files."""
    shown: list[str] = []
    monkeypatch.setattr(gait_figures, "overlay", lambda trajectories, roles: shown.extend(trajectories))
    gait = load_problem(STRIDER).baselines["stride"]
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        write_gait(tmp_path / folder / "gait.toml", gait)
    files = [str(tmp_path / folder / "gait.toml") for folder in ("one", "other")]
    assert cli.main(["compare", str(STRIDER), *files, "square", "--out", str(tmp_path / "c")]) == 0
    assert shown == ["one/gait", "other/gait", "square"]
