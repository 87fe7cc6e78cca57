"""The report of an audit."""

from pathlib import Path

from helpers import STRIDER
from pages import page_of

from gaitopt.cli import app as cli


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
