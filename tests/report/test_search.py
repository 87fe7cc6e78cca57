"""The report of a search."""

import json
from pathlib import Path

import pytest
from helpers import STRIDER
from pages import page_of
from pictures import needs_opengl

from gaitopt.cli import app as cli


@pytest.mark.slow
@needs_opengl
def test_a_full_report_has_a_film_and_sensitivities(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert (
        cli.main(["optimise", str(STRIDER), "--budget", "4", "--full", "--out", str(folder), "--quiet"]) == 0
    )
    names = {"speeds", "position", "periods", "gait", "angles", "convergence", "way", "walk"}
    names |= {"sensitivity", "sensitivity-model"}
    page = page_of(folder, names)
    assert "data:video/mp4" in page
    assert (folder / "report.html").stat().st_size < 5_000_000
    rows = json.loads((folder / "sensitivity.json").read_text())["rows"]
    assert {row["kind"] for row in rows} == {"gait", "model"}
    assert "gaitopt export" in page
