"""Kills, Ctrl-C, full disks, lost folders, two runs at once: no result is lost."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import STRIDER, edited, problem_folder

from gaitopt.cli import app as cli
from gaitopt.core import interrupts
from gaitopt.core.interrupts import interrupts_between_imports, interrupts_blocked, interrupts_held
from gaitopt.jobs.optimise import optimise
from gaitopt.problem.problem import load_problem
from gaitopt.runs import folder as folder_module
from gaitopt.runs import run_folder as run_folder_module
from gaitopt.runs.folder import filled_folder, held, write_into

GAITOPT = [sys.executable, "-c", "from gaitopt.cli import main; raise SystemExit(main())"]
BUDGET = ["--budget", "40", "--seed", "2", "--workers", "1"]
PATIENCE_S = 300.0
"""After this time a process counts as hanging, even on a busy machine."""


def start(*arguments: object, program: list[str] = GAITOPT, **options: Any) -> subprocess.Popen[str]:
    """Run gaitopt as a separate process in its own group."""
    command = [*program, *(str(argument) for argument in arguments)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **options
    )


def run(*arguments: object, **options: Any) -> tuple[int, str, str]:
    """Run gaitopt to its end."""
    process = start(*arguments, **options)
    out, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, out, err


def here(*arguments: object) -> int:
    """Run gaitopt in this process."""
    return cli.main([str(argument) for argument in arguments])


def result(folder: Path) -> dict[str, Any]:
    """Everything that a run found, to the last bit, without the figure that comes from a clock."""
    summary = json.loads((folder / "summary.json").read_text())
    del summary["wall_s"]
    return {"summary": summary} | {
        name: (folder / name).read_bytes() for name in ("best.toml", "evaluations.csv", "model.xml")
    }


def rows(folder: Path) -> int:
    path = folder / "evaluations.csv"
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


def once(happened: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    """Wait until something has happened, or the process has ended."""
    until = time.monotonic() + PATIENCE_S
    while not happened() and process.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.002)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an undisturbed run."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    assert here("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet") == 0
    return folder


MOMENTS: dict[str, Callable[[Path], bool]] = {
    "in its first second": lambda folder: (folder / "problem.toml").exists(),
    "in the search": lambda folder: rows(folder) > 20,
    "in the report": lambda folder: (folder / "figures").exists(),
}


@pytest.mark.slow
@pytest.mark.parametrize("moment", MOMENTS)
def test_a_killed_run_is_resumed_to_the_same_bits(whole: Path, tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    command = ("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet")
    process = start(*command)
    once(lambda: MOMENTS[moment](folder), process)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL, "it ended before it was killed"
    assert not (folder / "report.html").exists()
    again = ("optimise", folder, "--resume", folder, "--quiet")
    assert here(*(again if (folder / "run.toml").exists() else command)) == 0
    assert result(folder) == result(whole)
    assert {path.name for path in folder.iterdir()} == {path.name for path in whole.iterdir()}


@pytest.mark.slow
@pytest.mark.parametrize("moment", ["in the search", "in the report"])
def test_ctrl_c_says_what_was_found_and_how_to_go_on(whole: Path, tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "a run"
    process = start("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet")
    once(lambda: MOMENTS[moment](folder), process)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    lines = err.splitlines()
    assert lines[0].startswith(f"gaitopt: stopped after {rows(folder)} gaits, best so far ")
    assert lines[0].endswith(f"; go on with: gaitopt optimise '{folder}' --resume '{folder}'")
    assert lines[1:] == ["gaitopt: interrupted"]
    assert not (folder / ".lock").exists()
    assert here("optimise", folder, "--resume", folder, "--quiet") == 0
    assert result(folder) == result(whole)


def test_ctrl_c_ends_worker_processes_in_silence(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = start("optimise", STRIDER, *BUDGET, "--executor", "processes", "--out", folder, "--quiet")
    once(lambda: rows(folder) > 8, process)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert len(err.splitlines()) == 2


@pytest.mark.slow
def test_ctrl_c_at_any_moment_is_one_clean_end(tmp_path: Path) -> None:
    """From the first import of a command on; `test_kills.py` has the stages of the work after them."""
    begun = [sys.executable, "-c", GAITOPT[-1].replace("; ", "; print(flush=True); ")]
    rng = np.random.default_rng(7)
    for index, delay in enumerate(rng.uniform(0.03, 0.6, 4)):
        folder = tmp_path / f"run-{index}"
        process = start("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet", program=begun)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(delay)
        assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 130
        assert err.splitlines()[-1] == "gaitopt: interrupted"
        assert all(line.startswith("gaitopt: ") for line in err.splitlines()), err
        assert folder.exists() == (rows(folder) > 0)


@pytest.mark.slow
def test_ctrl_c_while_the_folder_is_filled_leaves_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    for index, delay in enumerate(0.06 * rng.uniform(size=8) ** 2):
        folder = tmp_path / f"run-{index}"
        process = start("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet")
        once(lambda folder=folder: folder.exists(), process)  # type: ignore[misc]
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, err.splitlines()[-1]) == (130, "gaitopt: interrupted")
        assert folder.exists() == (rows(folder) > 0)


@pytest.mark.slow
def test_sigterm_at_any_moment_is_one_clean_end(tmp_path: Path) -> None:
    """As a service manager or a batch system sends it, to worker processes too."""
    for index, executor in enumerate(("threads", "processes")):
        folder = tmp_path / f"run-{index}"
        process = start(
            "optimise", STRIDER, *BUDGET, "--executor", executor, "--out", folder, "--quiet", "--budget", 400
        )
        once(lambda folder=folder: rows(folder) > 8, process)  # type: ignore[misc]
        os.killpg(process.pid, signal.SIGTERM)
        _, err = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 143
        said, last = err.splitlines()
        assert said.startswith("gaitopt: stopped after ")
        assert f"gaitopt optimise {folder} --resume {folder}" in said
        assert last == "gaitopt: terminated"
        assert not (folder / ".lock").exists()


def edit_mass(folder: Path) -> None:
    edited(folder / "problem.toml", "value = 0.03\n", "value = 0.06\n")


@pytest.mark.slow
def test_the_run_folders_own_problem_decides_when_a_search_goes_on(tmp_path: Path) -> None:
    """The problem that it was made from may have changed since, or be gone."""
    robot = problem_folder(tmp_path / "robot", STRIDER)
    whole, folder = tmp_path / "whole", tmp_path / "run"
    assert here("optimise", robot, *BUDGET, "--out", whole, "--quiet") == 0
    process = start("optimise", robot, *BUDGET, "--out", folder, "--quiet")
    once(lambda: rows(folder) > 8, process)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    edit_mass(robot)
    assert here("optimise", robot, "--resume", folder, "--quiet") == 0
    assert result(folder) == result(whole)


def test_ctrl_c_waits_for_the_end_of_an_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A native module that is interrupted while it starts gives an ImportError instead."""
    (tmp_path / "slow_to_start.py").write_text(
        "import signal, time\nsignal.raise_signal(signal.SIGINT)\ntime.sleep(0.05)\nstarted = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    until = time.monotonic() + PATIENCE_S
    with pytest.raises(KeyboardInterrupt), interrupts_between_imports():  # noqa: PT012
        import slow_to_start  # type: ignore[import-not-found]

        time.sleep(PATIENCE_S)
    assert slow_to_start.started
    assert time.monotonic() < until, "the sleep was not interrupted"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_sent_twice_at_once_counts_once(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    said = []
    with pytest.raises(KeyboardInterrupt), interrupts_between_imports():  # noqa: PT012
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            signal.raise_signal(number)
            said.append("where to go on")
            monkeypatch.setattr(interrupts, "_SAME_S", 0.0)  # who sends it again later wants an end
            signal.raise_signal(number)
            said.append("too late")
    assert said == ["where to go on"]


@pytest.mark.slow
def test_two_processes_cannot_share_a_folder(whole: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = start("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet")
    once(lambda: rows(folder) > 0, process)
    other = run("optimise", folder, "--resume", folder, "--quiet")
    assert other == (1, "", f"gaitopt: {folder}: another run is working in this folder\n")
    code, _, err = run("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet")
    assert code == 1
    assert f"--out: {folder} already holds a run" in err
    assert process.communicate(timeout=PATIENCE_S)[1] == ""
    assert result(folder) == result(whole)


@pytest.mark.slow
def test_of_runs_started_together_one_gets_the_folder(whole: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    together = [start("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet") for _ in range(3)]
    ends = [process.communicate(timeout=PATIENCE_S)[1] for process in together]
    codes = [process.returncode for process in together]
    assert sorted(codes) == [0, 1, 1], ends
    assert all(len(err.splitlines()) == code for code, err in zip(codes, ends, strict=True))
    assert result(folder) == result(whole)


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_nothing_is_lost(whole: Path, tmp_path: Path) -> None:
    """A limit on file size replaces it: writing beyond the limit fails like writing to a full disk."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (14_000, 14_000))

    folder = tmp_path / "run"
    code, _, err = run("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet", preexec_fn=limit)
    assert (code, err) == (1, f"gaitopt: {folder / 'evaluations.csv'}: cannot be written: File too large\n")
    assert 0 < rows(folder) < 40
    assert here("optimise", folder, "--resume", folder, "--quiet") == 0
    assert result(folder) == result(whole)


def test_a_folder_removed_in_the_middle_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = start("optimise", STRIDER, *BUDGET, "--out", folder, "--quiet")
    once(lambda: rows(folder) > 10, process)
    shutil.rmtree(folder)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert err == f"gaitopt: {folder / 'evaluations.csv'}: cannot be written: No such file or directory\n"
    assert not folder.exists()


def test_ctrl_c_is_held_back_until_a_solver_is_done() -> None:
    """IPOPT would take it for a failure of the current start, and the plan would continue without it."""
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_held():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        done.append("solved")
    assert done == ["solved"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


MAKERS = {
    "a temporary file": (tempfile, "mkstemp"),
    "a folder": (folder_module, "make_folder"),
    "the folder of a run": (run_folder_module.RunFolder, "create"),
    "a lock": (folder_module.FolderLock, "take"),
}


@pytest.mark.parametrize("made", MAKERS)
def test_what_is_made_at_the_moment_of_ctrl_c_is_removed(
    made: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner, name = MAKERS[made]
    make = getattr(owner, name)

    def make_and_stop(*arguments: Any, **options: Any) -> Any:
        done = make(*arguments, **options)
        signal.raise_signal(signal.SIGINT)
        return done

    def fill() -> None:
        if made == "the folder of a run":
            optimise(problem, budget=4, out=tmp_path / "run")
        with filled_folder(tmp_path / "run", "run") as folder, held(folder):
            write_into(folder, "file.txt", "text")

    problem = load_problem(STRIDER)
    monkeypatch.setattr(owner, name, make_and_stop)
    with pytest.raises(KeyboardInterrupt):
        fill()
    assert not list(tmp_path.iterdir())


def test_a_process_that_an_import_starts_does_not_end_at_ctrl_c() -> None:
    """MuJoCo's import asks a library for its version in one, for a tenth of a second."""
    with pytest.raises(KeyboardInterrupt), interrupts_blocked():  # noqa: PT012
        child = subprocess.Popen([sys.executable, "-c", "print('done')"], stdout=subprocess.PIPE, text=True)
        child.send_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        out, _ = child.communicate(timeout=PATIENCE_S)
    assert (child.returncode, out) == (0, "done\n")
