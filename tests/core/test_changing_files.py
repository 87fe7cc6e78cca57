"""Files that change while they are read: one content or one clear line, and a run that reads each once."""

import json
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from helpers import STRIDER, brief_studies, edited, problem_folder

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_bytes, read_text
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import import_file
from gaitopt.gait.gait import read_gait
from gaitopt.optimise import evaluator
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import load_problem

READS = 40


@contextmanager
def rewritten(path: Path, one: bytes, other: bytes, whole: bool) -> Iterator[None]:
    """Rewrite a file again and again: in place or, if `whole`, by a rename."""
    done = threading.Event()

    def write() -> None:
        while not done.is_set():
            for data in (one, other):
                if whole:
                    (path.parent / "new").write_bytes(data)
                    (path.parent / "new").replace(path)
                else:
                    path.write_bytes(data)
                done.wait(5e-4)  # lets the reader have the interpreter

    writer = threading.Thread(target=write)
    writer.start()
    try:
        yield
    finally:
        done.set()
        writer.join()


def check_reads(path: Path, old: str, new: str, read: Callable[[], Any], whole: bool) -> None:
    """Every read of a file that keeps changing gives one of its contents, or one clear line."""
    one = path.read_bytes()
    other = one.replace(old.encode(), new.encode())
    found = []
    with rewritten(path, one, other, whole):
        for _ in range(READS):
            try:
                found.append(read())
            except GaitoptError:  # whose text is one line
                found.append(None)
    contents = []
    for data in (one, other):
        path.write_bytes(data)
        contents.append(read())
    assert contents[0] != contents[1]
    assert all(content is None or content in contents for content in found)
    assert not whole or None not in found


def bulk(text: str) -> str:
    """As long as a file of several pages, so that it is not written at once."""
    return text + "#\n" * 8_000


@pytest.mark.parametrize("whole", [True, False])
def test_a_gait_file_that_changes_is_one_or_the_other(tmp_path: Path, whole: bool) -> None:
    path = tmp_path / "gait.toml"
    path.write_text(bulk(load_problem(STRIDER).baselines["stride"].to_toml()))
    check_reads(path, "0.5", "0.7", lambda: read_gait(path), whole)


@pytest.mark.parametrize("whole", [True, False])
def test_a_problem_that_changes_is_one_or_the_other(tmp_path: Path, whole: bool) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    check_reads(folder / "problem.toml", "0.03", "0.05", lambda: load_problem(folder).file, whole)


@pytest.mark.parametrize("whole", [True, False])
def test_a_model_that_changes_is_one_or_the_other(tmp_path: Path, whole: bool) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    problem = load_problem(folder)

    def lengths() -> list[float]:
        return build_model(problem).geom_size.ravel().tolist()

    check_reads(folder / "strider.xml", 'size="0.002"', 'size="0.003"', lengths, whole)


@pytest.mark.parametrize("whole", [True, False])
def test_a_recording_that_changes_is_one_or_the_other(tmp_path: Path, whole: bool) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("t_s,x_m\n" + "".join(f"{0.05 * i:.2f},{0.01 * i:.3f}\n" for i in range(60)))

    def imported() -> list[float]:
        return import_file(path, ImportOptions()).signals["marker.x"].tolist()

    check_reads(path, ",0.", ",1.", imported, whole)


@pytest.mark.parametrize("whole", [True, False])
def test_a_data_set_that_changes_is_one_or_the_other(tmp_path: Path, whole: bool) -> None:
    (tmp_path / "walk.csv").write_text("t_s,x_m\n" + "".join(f"{0.05 * i:.2f},0.1\n" for i in range(60)))
    path, problem = tmp_path / "dataset.toml", load_problem(STRIDER)
    entry = (
        '[[trial]]\nname = "one"\ngait = "stride"\nfile = "walk.csv"\n[trial.signals]\n"marker.y" = "x_m"\n'
    )
    path.write_text(bulk(entry))

    def names() -> list[str]:
        return [trial.name for trial in load_dataset(tmp_path, problem, ["marker.y"]).trials]

    check_reads(path, '"one"', '"two"', names, whole)


def test_what_changed_while_it_was_read_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("t_s,x_m\n")
    fstat, calls = os.fstat, []

    def growing(handle: int) -> Any:
        calls.append(handle)
        if len(calls) % 2 == 0:
            with path.open("a") as file:
                file.write("0,1\n")
        return fstat(handle)

    monkeypatch.setattr("gaitopt.core.files.os.fstat", growing)
    for read in (read_text, read_bytes):
        with pytest.raises(GaitoptError, match="it changed while it was read; try again"):
            read(path)


@pytest.mark.slow
def test_a_command_reads_its_model_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A model that was saved again during a search became another robot in later stages."""
    for module, name, value in brief_studies():
        monkeypatch.setattr(module, name, value)
    folder = problem_folder(tmp_path / "robot", STRIDER)

    def speeds(name: str) -> list[object]:
        options = f"--budget 3 --no-warm-start --workers 1 --json --out {tmp_path / name}"
        assert cli.main(["optimise", str(folder), *options.split()]) == 0
        summary = json.loads(capsys.readouterr().out)
        return [summary["best"]["speed_m_s"], summary["verified"], summary["baselines"]]

    undisturbed, assess, changed = speeds("one"), evaluator.assess, []

    def disturbed(*arguments: Any) -> object:
        if not changed:
            path, foot = folder / "strider.xml", 'name="rear_foot" type="sphere" pos="0 0 -0.0{}"'
            changed.append(edited(path, foot.format(24), foot.format(14)))
        return assess(*arguments)

    monkeypatch.setattr(evaluator, "assess", disturbed)
    assert speeds("other") == undisturbed
    assert changed
