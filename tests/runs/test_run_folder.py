"""The run folder: nothing is left of a run that did nothing, no result is lost, one run at a time."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from helpers import STRIDER, edited, problem_folder
from hostility import CUBE
from searching import run

from gaitopt.core.errors import GaitoptError
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import Request
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.folder import write_into, write_problem
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


def with_mesh(folder: Path, name: str) -> Problem:
    """The strider with a mesh."""
    problem_folder(folder, STRIDER)
    element = f'<asset><mesh name="m" file="{name}"/></asset>'
    edited(folder / "strider.xml", "</worldbody>", "</worldbody>" + element)
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(CUBE)
    return load_problem(folder)


def test_the_files_that_a_model_names_are_in_a_run_folder(tmp_path: Path) -> None:
    """At any depth, and they go again where the run ends before its first gait."""
    problem, path = with_mesh(tmp_path / "robot", "assets/feet/m.obj"), tmp_path / "run"
    with RunFolder.create(path, problem, Request()):
        assert (path / "assets" / "feet" / "m.obj").read_bytes() == CUBE
        assert nominal_mjcf(load_problem(path)) == (path / "model.xml").read_text()
    assert not path.exists()
    path.mkdir()
    write_problem(path, problem, nominal_mjcf(problem))  # as a diagnosis does
    assert nominal_mjcf(load_problem(path)) == (path / "model.xml").read_text()


@pytest.mark.parametrize(
    "name",
    [
        *("Figures/m.obj", "pareto/m.obj", "simulated-0123/m.obj", ".lock/m.obj", "a/.m.abcd1234.obj"),
        *(".m.abcd1234.obj", "figures/speeds.OBJ"),
    ],
)
def test_a_model_names_no_file_of_a_run(name: str, tmp_path: Path) -> None:
    """The run would write over it, or remove it, and could not be resumed."""
    problem = with_mesh(tmp_path / "robot", name)
    with pytest.raises(GaitoptError, match="allowed: names that files of a run do not have"):
        RunFolder.create(tmp_path / "run", problem, Request())
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("element", "name"),
    [
        ('<model name="n" file="{}"/>', "model.xml"),
        *(('<hfield name="n" file="{}" size="1 1 1 1"/>', name) for name in ("run.toml", "evaluations.csv")),
    ],
)
def test_an_attached_model_and_a_height_field_are_no_file_of_a_run(
    element: str, name: str, tmp_path: Path
) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER, lambda c: c.update(model="strider.xml"))
    asset = f"<asset>{element.format(name)}</asset>"
    edited(folder / "strider.xml", "</worldbody>", "</worldbody>" + asset)
    hfield = b"\2\0\0\0\2\0\0\0" + 16 * b"\0"
    (folder / name).write_bytes(b"<mujoco/>" if name == "model.xml" else hfield)
    problem = load_problem(folder)
    with pytest.raises(GaitoptError, match="it names the file"):
        RunFolder.create(tmp_path / "run", problem, Request())
