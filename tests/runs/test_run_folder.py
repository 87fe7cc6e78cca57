"""The run folder: nothing is left of a run that did nothing, no result is lost, one run at a time."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from searching import run

from gaitopt.core.errors import GaitoptError
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import Request
from gaitopt.problem.problem import Problem
from gaitopt.runs.folder import write_into
from gaitopt.runs.run_folder import RunFolder


@pytest.mark.parametrize("existing", [False, True])
def test_a_run_that_ends_before_its_first_gait_leaves_nothing(
    strider: Problem, tmp_path: Path, existing: bool
) -> None:
    """This holds for a folder that existed and was empty, too; it can be used again."""
    path = tmp_path / "run"
    if existing:
        path.mkdir()
    with pytest.raises(RuntimeError, match="stop"), RunFolder.create(path, strider, Request()) as folder:  # noqa: PT012
        Journal(folder.journal, strider)
        raise RuntimeError("stop")
    assert path.exists() == existing
    assert not existing or list(path.iterdir()) == []


def test_a_run_that_was_interrupted_early_can_be_resumed(strider: Problem, tmp_path: Path) -> None:
    """Reopening a folder whose journal has only a header, and stopping again, removes nothing."""
    path = tmp_path / "run"
    with RunFolder.create(path, strider, Request()) as folder:
        journal = folder.journal
        run(strider, journal, Request(seed=1, budget=2))
    journal.write_text(journal.read_text().splitlines(keepends=True)[0])
    reopened = RunFolder.reopen(path)
    with reopened.folder:
        pass
    assert reopened.request == Request()
    assert reopened.problem.file.parameters == strider.file.parameters
    assert {"run.toml", "problem.toml", "model.xml", "evaluations.csv"} == {p.name for p in path.iterdir()}


def test_two_runs_into_one_folder_are_refused(strider: Problem, tmp_path: Path) -> None:
    path = tmp_path / "run"
    with RunFolder.create(path, strider, Request()):
        before = sorted(p.name for p in path.iterdir())
        second = RunFolder.reopen(path).folder
        with pytest.raises(GaitoptError) as error, second:
            pytest.fail("a second run got in")
        assert str(error.value) == f"{path}: another run is working in this folder"
        with pytest.raises(GaitoptError, match="already holds a run"):
            RunFolder.create(path, strider, Request())
        assert sorted(p.name for p in path.iterdir()) == before


def _full(*_: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("content", ["text", _full])
def test_a_file_that_cannot_be_written_is_named_as_it_was_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | Callable[[Path], object]
) -> None:
    """And not by the name of the temporary file."""
    monkeypatch.setattr(Path, "write_bytes", _full)
    with pytest.raises(GaitoptError) as caught:
        write_into(tmp_path, "figures/check.json", content)
    file = tmp_path / "figures" / "check.json"
    assert str(caught.value) == f"{file}: cannot be written: No space left on device"
    assert list(file.parent.iterdir()) == []
