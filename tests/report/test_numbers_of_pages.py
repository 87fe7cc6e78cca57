"""Every number in the tables and tiles of a page, and in the terminal, is one of the JSON file beside it."""

import json
import tomllib
from pathlib import Path

import pytest
from browser import CHROMIUM
from helpers import STRIDER
from page_audit import faults_of
from pages import foreign_numbers, tables_of, tiles_of
from planting import dataset, recording_of

from gaitopt.cli import app as cli
from gaitopt.problem.problem import Problem
from gaitopt.report.words import interval_text
from gaitopt.simulation.labels import shown
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario


def run(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """What a command that ends well prints."""
    assert cli.main([str(word) for word in words]) == 0
    return capsys.readouterr().out


def held_to(content: object, page: str, terminal: str) -> None:
    """Check that neither page nor terminal has a number of its own."""
    cells = [cell for rows in tables_of(page).values() for row in rows for cell in row]
    assert cells
    assert foreign_numbers([*cells, *tiles_of(page)], content) == []
    table = [line for line in terminal.splitlines() if not line.startswith("report:")]
    assert foreign_numbers(table, content) == []


def test_a_number_that_the_file_has_not_is_found() -> None:
    content = {"speed_m_s": 0.04567, "rows": [{"share": 0.125, "name": "square-1s"}]}
    assert foreign_numbers(["45.7 mm/s", "12.5 %", "−45.67", "square-1s", "1"], content) == ["-45.67"]
    assert foreign_numbers(["45.6", "46", "0.0457", "2.2"], content) == ["45.6", "2.2"]


def test_a_comparison_says_the_same_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "c"
    terminal = run(capsys, "compare", STRIDER, "stride", "square", "--out", out)
    content, page = json.loads((out / "compare.json").read_text()), (out / "report.html").read_text()
    # 90 % intervals; half of one beside each figure of the terminal; the scenarios' number
    halves = [
        (row[name][1] - row[name][0]) / 2.0
        for row in content["rows"]
        for name in ("speed_ci90_m_s", "difference_ci90_m_s", "ratio_ci90")
        if row[name]
    ]
    held_to([content, halves, 90], page, terminal)
    rows = tables_of(page)["Over the same scenarios"]
    for cells, row in zip(rows, content["rows"], strict=True):
        speeds = [f"{1e3 * row[name]:.2f}" for name in ("speed_m_s", "speed_worst_m_s")]
        assert [cells[0], cells[2], cells[4]] == [row["name"], *speeds]
        assert cells[3] == interval_text(row["speed_ci90_m_s"], ".2f")
        assert f"{row['name']} " in terminal
        assert speeds[0] in terminal


def test_a_sweep_says_the_same_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "s"
    terminal = run(capsys, "sweep", STRIDER, "square", "--over", "period_s=0.5,0.4", "--out", out)
    content, page = json.loads((out / "sweep.json").read_text()), (out / "report.html").read_text()
    held_to(content, page, terminal)
    for cells, row in zip(tables_of(page)["Each value"], content["rows"], strict=True):
        figures = [shown(name, row[name]) for name in ("speed_m_s", "stride_m", "sideways_m_s")]
        assert cells[:4] == [row["name"], *figures]
        assert all(figure in terminal for figure in figures)


def test_a_check_says_the_same_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "k"
    terminal = run(capsys, "check", STRIDER, "--out", out)
    content, page = json.loads((out / "check.json").read_text()), (out / "report.html").read_text()
    beyond = [
        ratio
        for one in content["findings"]
        if one["value"] and one["limit"]
        for ratio in (one["value"] / one["limit"], one["limit"] / one["value"])
    ]
    advice = tables_of(page)["What to do"]
    times = [int(row[1]) for row in advice]
    assert len(times) == len({one["name"] for one in content["findings"]})
    assert sum(times) == len(content["findings"])
    held_to([content, beyond, times, [row[2] for row in advice]], page, terminal)
    for cells, one in zip(tables_of(page)["Every finding"], content["findings"], strict=True):
        assert one["message"].replace("%", " %") == cells[3]
        assert one["message"] in terminal


@pytest.mark.slow
def test_a_search_says_the_same_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    terminal = run(capsys, "optimise", STRIDER, "--budget", 4, "--out", out, "--quiet")
    content, page = json.loads((out / "summary.json").read_text()), (out / "report.html").read_text()
    gait = tomllib.loads((out / "best.toml").read_text())
    margins = [len(row["broken_in"]) for row in content["best"]["margins"]]
    ends = [one["offset_deg"] + one["amplitude_deg"] for one in gait["channels"].values()]
    held_to([content, gait, ends, margins, 90], page, terminal)
    limits = {row["constraint"]: row for row in content["best"]["margins"]}
    assert len(tables_of(page)["Limits and margins"]) == len(limits) > 0


@pytest.mark.slow
def test_a_diagnosis_says_the_same_everywhere(
    arcfold: Problem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    simulator = Simulator.build(arcfold, (Scenario(start_pose_rad=0.002, pose_seed=3),))
    columns = recording_of(simulator.run(arcfold.baselines["square-1s"], duration=4.0))
    trials, out = dataset(tmp_path / "trials", {"fast": ("square-1s", columns)}), tmp_path / "d"
    terminal = run(capsys, "diagnose", "arcfold", trials, "--out", out, "--quiet")
    content, page = json.loads((out / "diagnosis.json").read_text()), (out / "report.html").read_text()
    held_to([content, 90], page, terminal)
    assert len(tables_of(page)["Each signal"]) == len(content["trials"][0]["signals"])
    if CHROMIUM is not None:
        assert faults_of(out / "report.html") == []
