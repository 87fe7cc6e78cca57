"""Attacks with a folder in which a command is run: files that libraries would look for in it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from helpers import STRIDER, problem_folder
from watching import watched

from gaitopt.optimise.processes import ProcessExecutor
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.solution import Box
from gaitopt.optimise.solvers.solver import Minimisation
from gaitopt.plan.collocation import IPOPT_OPTIONS
from gaitopt.problem.lookup import bundled_problems


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, a stranger's."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize("module", ["multiprocessing", "numpy", "gaitopt", "socket"])
def test_worker_processes_import_nothing_from_the_current_folder(
    module: str, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python begins its worker processes with ``python -c``, which imports from there first."""
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    (here / f"{module}.py").write_text(f"open({str(here / 'ran')!r}, 'w')\nraise SystemExit('owned')\n")
    with ProcessExecutor(1, lives=1) as executor:
        assert executor.submit(os.getcwd).result() == str(here)
    assert not (here / "ran").exists()


def test_ipopt_reads_no_options_in_the_current_folder(here: Path) -> None:
    """They would name files that it writes."""
    victim = here.parent / "notes.txt"
    victim.write_text("mine")
    (here / "ipopt.opt").write_text(f"output_file {victim}\nfile_print_level 5\nmax_iter 0\n")
    x = ca.SX.sym("x")
    solver = ca.nlpsol("plan", "ipopt", {"x": x, "f": (x - 1) ** 2}, IPOPT_OPTIONS)
    assert float(solver(x0=0)["x"]) == pytest.approx(1.0)
    assert victim.read_text() == "mine"


def test_cma_es_reads_no_signals_in_the_current_folder(here: Path) -> None:
    """They could end the search, or change its result."""

    def costs(points: np.ndarray) -> np.ndarray:
        return np.sum((points - 0.3) ** 2, axis=1)

    def found() -> list[float]:
        box, start, rng = Box(np.zeros(2, dtype=bool)), np.full(2, 0.5), np.random.default_rng(1)
        return list(CmaEs().minimise(Minimisation(costs, box, start, 0.2, 60, rng)).x)

    undisturbed = found()
    for signals in ("{'maxiter': 1}", "{'ftarget': 'np.inf'}", "{'ftarget': 'x'}", "not a dictionary"):
        (here / "cma_signals.in").write_text(signals)
        assert found() == undisturbed


@pytest.mark.parametrize("kind", ["a file", "a link", "a pipe"])
def test_matplotlib_reads_no_settings_in_the_current_folder(kind: str, here: Path) -> None:
    (here.parent / "settings").write_text("lines.linewidth: 77\ntext.usetex: True\n")
    if kind == "a file":
        (here.parent / "settings").rename(here / "matplotlibrc")
    elif kind == "a link":
        (here / "matplotlibrc").symlink_to(here.parent / "settings")
    else:
        os.mkfifo(here / "matplotlibrc")
    code = (
        f"from gaitopt.cli.app import main; main(['effects', {str(STRIDER)!r}, '--json']); "
        "from gaitopt.report.page import plt; print(plt.rcParams['lines.linewidth'])"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.splitlines()[-1] != "77.0"


DECOYS = ("ipopt.opt", "cma_signals.in", "matplotlibrc", "MUJOCO_LOG.TXT", "outcmaes")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
@pytest.mark.parametrize("command", ["optimise", "plan", "compare", "diagnose"])
def test_a_command_opens_only_its_own_files_in_the_current_folder(command: str, here: Path) -> None:
    """Watched by strace, in a problem's folder with files that libraries look for."""
    here.rmdir()
    problem_folder(here, STRIDER if command == "optimise" else bundled_problems() / "arcfold")
    os.chdir(here)
    own = {path.name for path in here.iterdir()}
    for name in DECOYS:
        (here / name).write_text("")
    words = {
        "optimise": (
            ".",
            "--budget",
            40,
            "--seed",
            5,
            "--quiet",
            "--executor",
            "processes",
            "--out",
            "../run",
        ),
        "plan": (".",),
        "compare": (".", "square-1s", "square-0.5s", "--out", "../compared"),
        "diagnose": (".", "../trials", "--effects", "ground_slope", "--quiet", "--out", "../diagnosed"),
    }
    if command == "diagnose":
        make = ("--cases", 1, "--kind", "none", "--gaits", "square-1s", "--seconds", 3, "--out", "../cases")
        assert watched("blind", "make", ".", *make, settings=here.parent / "settings").code == 0
        (here.parent / "cases" / "case-000").rename(here.parent / "trials")
    seen = watched(command, *words[command], settings=here.parent / "settings")
    assert seen.code == 0, seen.err
    assert {path.name for path in seen.opened if path.parent == here} <= own
    assert {path for path in seen.changed if path.is_relative_to(here)} == set()
