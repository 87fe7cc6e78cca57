"""`gaitopt optimise --resume`: the same bits as an uninterrupted run."""

import shutil
import tomllib
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from commandline import RUN_FILES, Run, strictly, without_clock
from helpers import STRIDER, edited

from gaitopt.optimise.recorder import Recorder
from gaitopt.report import search as search_page


def interrupt_after(monkeypatch: pytest.MonkeyPatch, batches: int) -> None:
    """Press Ctrl-C when that many batches are done."""
    original, done = Recorder._assess, []

    def assess(self: Recorder, method: str, *arguments: Any) -> Any:
        if len(done) == batches:
            raise KeyboardInterrupt
        done.append(method)
        return original(self, method, *arguments)

    monkeypatch.setattr(Recorder, "_assess", assess)


@pytest.mark.parametrize("batches", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_an_interrupted_run_is_resumed_to_the_same_bits(
    gaitopt: Run, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batches: int
) -> None:
    folder = tmp_path / "run"
    with monkeypatch.context() as patch:
        interrupt_after(patch, batches)
        code, out, err = gaitopt("optimise", STRIDER, "--budget", 12, "--seed", 5, "--out", folder, "--quiet")
    assert (code, out) == (130, "")
    assert f"gaitopt optimise {folder} --resume {folder}" in err
    assert not (folder / "summary.json").exists()
    assert not (folder / ".lock").exists()
    code, out, err = gaitopt("optimise", folder, "--resume", folder, "--json")
    assert (code, err) == (0, "")
    for name in ("evaluations.csv", "best.toml", "model.xml", "problem.toml"):
        assert (folder / name).read_bytes() == (finished / name).read_bytes(), name
    assert without_clock(folder) == without_clock(finished)
    assert {path.name for path in folder.iterdir()} == RUN_FILES


def test_a_run_interrupted_before_its_first_gait_leaves_nothing(
    gaitopt: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_after(monkeypatch, 0)
    code, _, err = gaitopt("optimise", STRIDER, "--budget", 12, "--out", tmp_path / "run", "--quiet")
    assert (code, err) == (130, "gaitopt: interrupted\n")
    assert not (tmp_path / "run").exists()


def test_resuming_a_finished_run_prints_its_result(gaitopt: Run, finished: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in finished.rglob("*") if path.is_file()}
    code, out, err = gaitopt("optimise", STRIDER, "--resume", finished, "--json")
    assert (code, err) == (0, "")
    assert strictly(out) == strictly((finished / "summary.json").read_text())
    code, out, _ = gaitopt("optimise", STRIDER, "--resume", finished)
    assert code == 0
    assert "The best gait moves at " in out
    assert {path: path.stat().st_mtime_ns for path in finished.rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_a_run_stopped_while_it_wrote_its_report_is_not_finished(
    gaitopt: Run, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A resumed run writes the report, too."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    folder = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(search_page, "write_report", interrupted)
        assert gaitopt("optimise", STRIDER, "--budget", 12, "--seed", 5, "--out", folder, "--quiet")[0] == 130
    assert gaitopt("optimise", STRIDER, "--resume", folder, "--quiet")[0] == 0
    assert {path.name for path in folder.iterdir()} == RUN_FILES
    assert without_clock(folder) == without_clock(finished)


@pytest.mark.parametrize(
    "option", [("--budget", 3), ("--seed", 1), ("--method", "cma-es"), ("--out", "x"), ("--no-warm-start",)]
)
def test_resume_takes_everything_from_the_folder(
    gaitopt: Run, finished: Path, option: Sequence[object]
) -> None:
    code, out, err = gaitopt("optimise", STRIDER, "--resume", finished, *option)
    assert (code, out) == (1, "")
    name = str(option[0]).replace("--no-", "--")
    assert err == f"gaitopt: {name}: not with --resume, which takes it from {finished}\n"


def test_a_run_of_another_version_is_refused_unless_it_is_finished(
    gaitopt: Run, finished: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(finished, folder)
    made = tomllib.loads((folder / "run.toml").read_text())
    for name in ("gaitopt", "mujoco", "numpy"):
        assert made[name] == version(name)
        (folder / "run.toml").write_text(tomli_w.dumps(made | {name: "0.0.1"}))
        assert gaitopt("optimise", folder, "--resume", folder, "--json")[0] == 0
        (folder / "summary.json").rename(tmp_path / "summary.json")
        code, out, err = gaitopt("optimise", folder, "--resume", folder)
        said = f"{name}: found '0.0.1'; allowed: {version(name)}, the version here, to go on"
        assert (code, out, err) == (1, "", f"gaitopt: {folder / 'run.toml'}: {said}\n")
        (tmp_path / "summary.json").rename(folder / "summary.json")


def test_resume_with_a_changed_parameter_is_refused(gaitopt: Run, finished: Path) -> None:
    code, _, err = gaitopt("optimise", STRIDER, "--resume", finished, "--set", "mass=1")
    assert (code, err) == (1, f"gaitopt: --set: not with --resume, which takes it from {finished}\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("budget = 12", 'budget = "many"', "budget"),
        ("budget = 12", "", "run.toml: budget: missing; it is required"),
        ("seed = 5", "seed = 5.5", "seed"),
        ("budget = 12", "budget = ", "run.toml: not TOML"),
    ],
)
def test_a_spoiled_request_is_one_line(
    gaitopt: Run, finished: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    for name in ("run.toml", "problem.toml", "model.xml"):
        (tmp_path / name).write_bytes((finished / name).read_bytes())
    edited(tmp_path / "run.toml", old, new)
    code, out, err = gaitopt("optimise", STRIDER, "--resume", tmp_path)
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert message in err
