"""The report of a comparison."""

import re
from pathlib import Path

import pytest
from helpers import STRIDER
from pages import page_of

from gaitopt.cli import app as cli
from gaitopt.report.page import typeset


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
