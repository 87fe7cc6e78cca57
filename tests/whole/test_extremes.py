"""Extreme figures, sizes and machines."""

import ast
import ctypes
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER, problem_folder
from hostility import refused, run, trees

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_toml
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.gait import write_gait
from gaitopt.problem.model import build_model, carrying
from gaitopt.problem.problem import load_problem


@pytest.mark.parametrize(
    "name", ["a b", "naïve 机器人", "quo'te\"s", "new\nline", "-rf", "*?[x]", "{}", "%s", "é" * 60]
)
def test_folders_of_any_name_work(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = problem_folder(tmp_path / name, STRIDER)
    write_gait(folder / f"{name}.toml", load_problem(folder).baselines["stride"])
    out = folder / f"{name}.csv"
    arguments = ("command", folder, folder / f"{name}.toml", "--dt", 0.1, "--duration", 1, "--out", out)
    assert run(capsys, *arguments) == (0, "")
    assert len(out.read_text().splitlines()) == 11


@pytest.mark.parametrize(
    "change", [lambda t: t.replace("\n", "\r\n"), lambda t: "\ufeff" + t, lambda t: t + "\n\n"]
)
def test_the_text_files_of_other_systems_are_read(tmp_path: Path, change: Callable[[str], str]) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    for name in ("problem.toml", "strider.xml"):
        (folder / name).write_bytes(change((folder / name).read_text()).encode())
    assert load_problem(folder).file == load_problem(STRIDER).file
    assert build_model(load_problem(folder)).nu == 2


@pytest.mark.parametrize("content", [b"", b"\n", b"\x00", b"\xff\xfe", b"t_s", b"x" * 100_000])
@pytest.mark.parametrize("command", ["gait", "problem", "mjcf", "import", "dataset"])
def test_empty_and_one_line_files_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, command: str
) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    if command == "mjcf":
        problem_folder(tmp_path / "robot", STRIDER)
        (tmp_path / "robot" / "strider.xml").write_bytes(content)
    if command == "dataset":
        with pytest.raises(GaitoptError):
            load_dataset(path, load_problem(STRIDER), ["marker.x"])
        return
    arguments = {
        "gait": ("command", STRIDER, path, "--dt", 0.1, "--duration", 1, "--out", tmp_path / "out"),
        "problem": ("model", path, "--out", tmp_path / "out"),
        "mjcf": ("model", tmp_path / "robot", "--out", tmp_path / "out"),
        "import": ("import", path, "--problem", STRIDER, "--gait", "stride", "--out", tmp_path / "out"),
    }[command]
    assert run(capsys, *arguments)[0] == 1
    assert not (tmp_path / "out").exists()


def test_a_file_that_vanishes_while_it_is_read_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Between two steps: each check finds the file, and each read does not."""
    folder = problem_folder(tmp_path / "robot", STRIDER)
    monkeypatch.setattr(Path, "is_file", lambda self: True)
    for name in ("strider.xml", "problem.toml"):
        (folder / name).unlink()
        code, err = run(capsys, "model", folder, "--out", tmp_path / "out.xml")
        assert (code, "no such file" in err or "found 0 MJCF files" in err) == (1, True)


def test_a_file_that_changes_while_it_is_read_is_read_as_it_was_or_refused(tmp_path: Path) -> None:
    """Files are read once and completely, so a problem and its model agree."""
    problem = carrying(load_problem(problem_folder(tmp_path / "robot", STRIDER)))
    before = build_model(problem).key_qpos
    (tmp_path / "robot" / "strider.xml").write_text("<mujoco/>")
    assert np.array_equal(build_model(problem).key_qpos, before)


def test_no_figure_depends_on_a_clock_that_can_jump() -> None:
    """`time.monotonic` cannot jump; no other clock is read."""
    for path, tree in trees():
        for node in ast.walk(tree):
            called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            assert called not in {"time.time", "datetime.now", "datetime.datetime.now", "time.localtime"}, (
                path
            )


@pytest.mark.slow
def test_a_clock_that_jumps_changes_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every reading of every clock is another day, before or after the last."""
    arguments = ["optimise", str(STRIDER), "--budget", "12", "--seed", "2", "--workers", "1", "--quiet"]
    assert cli.main([*arguments, "--out", str(tmp_path / "steady")]) == 0
    days = np.random.default_rng(3)
    with monkeypatch.context() as patch:
        for name in ("time", "monotonic", "perf_counter"):
            patch.setattr(time, name, lambda: 86_400.0 * days.uniform(-1e4, 1e4))
        assert cli.main([*arguments, "--out", str(tmp_path / "jumping")]) == 0
    for name in ("evaluations.csv", "best.toml", "model.xml", "problem.toml", "run.toml"):
        assert (tmp_path / "steady" / name).read_bytes() == (tmp_path / "jumping" / name).read_bytes(), name
    steady, jumping = (
        json.loads((tmp_path / name / "summary.json").read_text()) for name in ("steady", "jumping")
    )
    assert steady.pop("wall_s") != jumping.pop("wall_s")
    assert steady == jumping


def test_too_little_memory_is_one_line_and_writes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    code = (
        "import resource\nimport gaitopt.simulation.rollout\n"
        "from pathlib import Path\nfrom gaitopt.cli import main\n"
        "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + (200 << 20), used + (200 << 20)))\n"
        "raise SystemExit(main())"
    )
    arguments = ["command", str(STRIDER), "stride", "--dt", "1e-6", "--duration", "40", "--out", str(out)]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (1, "gaitopt: out of memory\n")
    assert not out.exists()


PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2
"""For a process that has these capabilities, as the superuser's do, no folder is read-only."""


def without_privilege() -> None:
    """Give up what makes the superuser write anywhere; it counts from the next program on."""
    for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)


@pytest.mark.parametrize(
    "words",
    [
        ["model", "robot", "--out", "out.xml"],
        ["optimise", "robot", "--out", "out"],
        ["optimise", "robot", "--out", "."],
        ["export", "robot", "stride", "--format", "c", "--out", "out"],
        ["new", "bot", "--mjcf", "robot/strider.xml", "--out", "out"],
    ],
)
def test_a_read_only_folder_is_one_line(words: list[str], tmp_path: Path) -> None:
    places = {"robot": STRIDER, "robot/strider.xml": STRIDER / "strider.xml"}
    places |= {word: tmp_path / word for word in ("out", "out.xml", ".")}
    code = "from gaitopt.cli import main; raise SystemExit(main())"
    command = [sys.executable, "-c", code, *(str(places.get(word, word)) for word in words)]
    tmp_path.chmod(0o555)
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, preexec_fn=without_privilege
    )
    tmp_path.chmod(0o755)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert str(tmp_path) in done.stderr
    assert "Permission denied" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("out", ["/proc/out.xml", "/dev/full/x", "/dev/null/x"])
def test_a_folder_that_takes_no_files_is_one_line(capsys: pytest.CaptureFixture[str], out: str) -> None:
    code, err = run(capsys, "model", STRIDER, "--out", out)
    assert code == 1
    assert err.startswith(f"gaitopt: {out}: cannot be written: ")


def test_one_core_is_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = (
        "import os\nos.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n"
        "from gaitopt.cli import main\nraise SystemExit(main())"
    )
    arguments = ["compare", str(STRIDER), "stride", "square", "--json"]
    command = [sys.executable, "-c", code, *arguments]
    alone = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    assert cli.main([*arguments, "--workers", "3"]) == 0
    assert capsys.readouterr().out == alone


def test_read_toml_names_a_file_that_is_a_folder(tmp_path: Path) -> None:
    assert "found a folder; allowed: a plain file" in refused(lambda: read_toml(tmp_path))
