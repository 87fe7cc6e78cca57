"""`gaitopt runs`: what lies in run folders, in a table, as JSON and on a page."""

import os
import re
import shutil
from pathlib import Path

import pytest
from browser import needs_browser
from commandline import Run, refused, strictly
from edited_runs import as_if_killed
from helpers import edited
from page_audit import faults_of

from gaitopt.runs.lock import FolderLock, is_held


@pytest.fixture
def three(finished: Path) -> Path:
    """A folder with a finished run, one that was killed and one whose summary was spoiled."""
    for name in ("done", "killed", "spoiled"):
        shutil.copytree(finished, Path("all") / name)
    as_if_killed(Path("all/killed"))
    edited(Path("all/spoiled/summary.json"), '"best"', '"worst"')
    for minute, name in enumerate(("done/summary.json", "killed/evaluations.csv", "spoiled/summary.json")):
        os.utime(Path("all") / name, (1.7e9 + 60 * minute,) * 2)
    (Path("all") / "no-run").mkdir()
    return Path("all")


def test_runs_are_listed_with_speed_date_and_state(gaitopt: Run, three: Path) -> None:
    code, out, err = gaitopt("runs", three)
    assert (code, err) == (0, "")
    speed = strictly((three / "done/summary.json").read_text())["best"]["speed_m_s"]
    rows = [line.split() for line in out.splitlines() if line.strip().startswith("all/") and ":" in line]
    assert [row[0] for row in rows[:3]] == ["all/done", "all/killed", "all/spoiled"]
    assert rows[0][1:3] == ["strider", f"{1e3 * speed:.1f}"]
    assert [row[-1] for row in rows[:3]] == ["finished", "interrupted", "unreadable"]
    assert all(re.fullmatch(r"2023-11-1[45]", row[-3]) for row in rows[:3])
    assert "all/spoiled: all/spoiled/summary.json: best: missing" in " ".join(out.split())


def test_runs_as_json(gaitopt: Run, three: Path) -> None:
    rows = strictly(gaitopt("runs", three, "--json")[1])["rows"]
    best = strictly((three / "done/summary.json").read_text())["best"]
    assert rows[0]["speed_m_s"] == best["speed_m_s"]
    assert rows[0] | {"state": "finished", "problem": "strider", "seed": 5} == rows[0]
    assert rows[1]["speed_m_s"] is None
    (row,) = strictly(gaitopt("runs", three / "done", "--json")[1])["rows"]
    assert row == rows[0]


def test_a_run_that_works_is_running(gaitopt: Run, three: Path) -> None:
    lock = FolderLock(three / "killed")
    assert not is_held(three / "killed")
    lock.take()
    assert is_held(three / "killed")
    assert strictly(gaitopt("runs", three, "--json")[1])["rows"][1]["state"] == "running"
    lock.release()
    assert strictly(gaitopt("runs", three, "--json")[1])["rows"][1]["state"] == "interrupted"


def test_without_a_folder_runs_are_looked_for_here_and_in_results(gaitopt: Run, finished: Path) -> None:
    assert gaitopt("runs")[1].startswith("no runs here")
    shutil.copytree(finished, "mine")
    shutil.copytree(finished, "results/runs/strider-001")
    rows = strictly(gaitopt("runs", "--json")[1])["rows"]
    assert {row["folder"] for row in rows} == {"mine", "results/runs/strider-001"}


def test_what_cannot_be_listed_is_one_line(gaitopt: Run) -> None:
    assert refused(gaitopt, "runs", "nowhere") == "nowhere: no such folder"


def test_a_link_in_a_run_folder_is_not_followed(gaitopt: Run, three: Path) -> None:
    for name in ("summary.json", "evaluations.csv"):
        (three / "done" / name).rename(three / name)
        (three / "done" / name).symlink_to(Path("..") / name)
    rows = strictly(gaitopt("runs", three, "--json", "--html", "runs.html")[1])["rows"]
    (row,) = (row for row in rows if row["folder"] == "all/done")
    assert row["state"] == "unreadable"


def test_the_page_has_all_runs_and_leads_to_their_pages(gaitopt: Run, three: Path) -> None:
    Path("pages").mkdir()
    code, out, _ = gaitopt("runs", three, "--html", "pages/runs.html")
    assert code == 0
    assert "page: pages/runs.html" in out
    page = Path("pages/runs.html").read_text()
    assert 'href="../all/done/report.html"' in page
    assert "strider: the best gaits side by side" in page
    speed = strictly((three / "done/summary.json").read_text())["best"]["speed_m_s"]
    assert f"<td>{1e3 * speed:.1f}</td>".replace("-", "−") in page
    assert "://" not in re.sub(r"http://www\.w3\.org/\S+", "", page)
    assert [path.name for path in Path("pages").iterdir()] == ["runs.html"]


@needs_browser
def test_the_page_is_legible(gaitopt: Run, three: Path) -> None:
    gaitopt("runs", three, "--html", "runs.html")
    assert faults_of(Path("runs.html")) == []
