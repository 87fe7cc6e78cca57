"""Commands and functions are the same jobs: the same files, and no work done in the command line."""

import ast
from pathlib import Path

import pytest
from helpers import STRIDER

import gaitopt
from gaitopt.cli import app as cli
from gaitopt.cli import commands
from gaitopt.problem.problem import Problem

COMMAND_FILES = sorted(Path(commands.__file__).parent.glob("[a-z]*.py"))

WORDS = {
    "gaitopt.blind.kinds",
    "gaitopt.blind.scoring",  # sentences
    "gaitopt.diagnose.record.export",  # the record of import's options
    "gaitopt.export.formats",
    "gaitopt.export.handover",  # the record of export's options
    "gaitopt.plan.plan",  # what the planar model misses
    "gaitopt.report.words",  # sentences
    "gaitopt.simulation.audit.finding",  # findings said briefly
}
"""What commands import beside jobs: names, records and words."""


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, without the one figure that comes from a clock."""
    files = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
    return {
        name: b"\n".join(line for line in path.read_bytes().split(b"\n") if b'"wall_s"' not in line)
        for name, path in files.items()
        if name != "report.html"  # which shows it, too
    }


@pytest.mark.parametrize("path", COMMAND_FILES, ids=lambda path: path.stem)
def test_a_command_leaves_the_work_to_a_job(path: Path) -> None:
    imported = {
        node.module
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("gaitopt.")
    }
    rows = {"gaitopt.jobs", "gaitopt.cli", "gaitopt.core"}
    assert {name for name in imported if ".".join(name.split(".")[:2]) not in rows} <= WORDS
    if path.stem != "completion":
        assert any(name.startswith("gaitopt.jobs.") for name in imported)


def test_every_file_of_commands_is_registered() -> None:
    names = {command.name for command in commands.COMMANDS}
    files = {{"imports": "import"}.get(path.stem, path.stem) for path in COMMAND_FILES}
    assert names == files
    assert len(commands.COMMANDS) == len(files)


@pytest.mark.slow
def test_optimise_leaves_the_same_files(strider: Problem, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["optimise", str(STRIDER), "--budget", "4", "--seed", "3", "--out", "a", "--quiet"]) == 0
    run = gaitopt.optimise(strider, budget=4, seed=3, out="b")
    assert content(Path("a")) == content(Path("b"))
    alone = gaitopt.optimise(strider, budget=4, seed=3)
    assert alone.folder is None
    assert alone.optimised.best.gait == run.optimised.best.gait
    assert alone.summary.best == run.summary.best
    assert {path.name for path in Path().iterdir()} == {"a", "b"}


@pytest.mark.slow
def test_compare_leaves_the_same_files(strider: Problem, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", str(STRIDER), "stride", "square", "--out", "a", "--json"]) == 0
    gaitopt.compare(strider, ["stride", "square"], out="b")
    assert content(Path("a")) == content(Path("b"))
    assert (Path("a") / "report.html").read_bytes() == (Path("b") / "report.html").read_bytes()
