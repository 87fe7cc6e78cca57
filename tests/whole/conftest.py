"""A finished run, and one that was killed, for attacks on run folders."""

import shutil
from pathlib import Path

import pytest
from edited_runs import as_if_killed
from helpers import STRIDER

from gaitopt.cli import app as cli


@pytest.fixture(scope="session")
def finished_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the strider."""
    folder = tmp_path_factory.mktemp("attacked") / "run"
    words = f"optimise {STRIDER} --budget 6 --seed 5 --no-warm-start --quiet --out {folder}"
    assert cli.main(words.split()) == 0
    return folder


@pytest.fixture
def finished(finished_folder: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    shutil.copytree(finished_folder, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def unfinished(finished: Path) -> Path:
    """The same, as if it had been killed after three gaits."""
    return as_if_killed(finished)


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A folder of the user, with files that a sweep of leftovers would take for its own."""
    folder = tmp_path / "victim"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / ".notes.abcd1234.txt").write_text("mine")
    return folder
