"""Bad files and options: one line that says what is wrong, and nothing left behind."""

from pathlib import Path

import pytest
from commandline import Run, gait_file, refused
from helpers import STRIDER, edited, problem_folder

from gaitopt.optimise.run import Request
from gaitopt.problem.problem import Problem
from gaitopt.runs.run_folder import RunFolder


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("channels.rear", "channels.raer", "gait.toml: unknown channel 'raer'; known: rear, front (nearest: 'rear')"),  # noqa: E501
        ("duty = 0.4", "duty = 1.4", "gait.toml: channels.rear.duty: found 1.4; allowed: less than or equal to 1"),  # noqa: E501
        ("period_s = 0.4", "period_s = -0.4", "gait.toml: period_s: found -0.4; allowed: greater than or equal to 0.001"),  # noqa: E501
        ("duty = 0.4", "duty = nan", "gait.toml: channels.rear.duty: found nan; allowed: "),
        (
            "amplitude_deg = 30.0",
            "amplitude_deg = 300.0",
            "gait.toml: channels.rear: found 'targets from -15 to 285 degrees'; "
            "allowed: the servo's -45 to 45",
        ),
        ("period_s = 0.4", "period_s = ", "gait.toml: not TOML: "),
    ],
)  # fmt: skip
def test_a_bad_gait_file(gaitopt: Run, strider: Problem, old: str, new: str, message: str) -> None:
    path = gait_file(strider, old, new)
    for command in (
        ("simulate", STRIDER, path),
        ("compare", STRIDER, "square", path),
        ("sweep", STRIDER, path, "--over", "period_s=1"),
        ("command", STRIDER, path, "--dt", 0.01, "--duration", 1, "--out", "command.csv"),
    ):
        assert refused(gaitopt, *command).startswith(message)


@pytest.mark.parametrize("period_s", [1e9, 1e300])
def test_a_gait_too_slow_to_simulate(gaitopt: Run, strider: Problem, period_s: float) -> None:
    path = gait_file(strider, "period_s = 0.4", f"period_s = {period_s!r}")
    assert "period_s" in refused(gaitopt, "simulate", STRIDER, path)


@pytest.mark.parametrize("command", ["optimise", "check", "model"])
@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("problem.toml", 'marker = "nose"', 'marker = "noes"', "unknown site in roles.marker: 'noes'"),
        ("strider.xml", 'name="front" joint', 'name="fornt" joint', "channels.front: "),
        ("strider.xml", "</worldbody>", "", "broken XML: "),
        ("problem.toml", "duty = 0.4", "duty = 4", "found 4; allowed: "),
        ("problem.toml", "value = 0.5", "value = nan", "found nan; allowed: a finite number"),
    ],
)
def test_a_bad_problem(gaitopt: Run, command: str, name: str, old: str, new: str, message: str) -> None:
    folder = problem_folder(Path("robot"), STRIDER)
    edited(folder / name, old, new)
    options = {"optimise": ("--out", "run", "--budget", 2), "model": ("--out", "m.xml")}.get(command, ())
    assert message in refused(gaitopt, command, folder, *options)


def test_an_unknown_metric_in_the_objective(gaitopt: Run) -> None:
    folder = problem_folder(Path("robot"), STRIDER)
    edited(folder / "problem.toml", "speed_m_s = -1.0", "sped_m_s = -1.0")
    for command in (("optimise", folder, "--budget", 2, "--out", "run"), ("compare", folder, "square")):
        assert "unknown metric 'sped_m_s'" in refused(gaitopt, *command)


BAD_OPTIONS = {
    "budget of 0": (("optimise", "--budget", 0), "--budget: found 0; allowed: 1 or more"),
    "negative seed": (("optimise", "--seed", -1), "--seed: found -1; allowed: 0 or more"),
    "no workers": (("optimise", "--workers", 0), "--workers: found 0; allowed: 1 or more"),
    "unknown method": (
        ("optimise", "--method", "cma_es"),
        "--method: found 'cma_es'; allowed: default, cma-es, nelder-mead (nearest: 'cma-es')",
    ),
    "unknown executor": (
        ("optimise", "--executor", "thread"),
        "--executor: found 'thread'; allowed: threads, processes, serial or dask://HOST:PORT "
        "(nearest: 'threads')",
    ),
    "nothing to resume": (("optimise", "--resume", "gone"), "--resume: gone: not a run folder (no run.toml)"),
    "unknown parameter": (("simulate", "square", "--set", "mu_raer=1"), "unknown parameter 'mu_raer'; known: "),  # noqa: E501
    "NaN parameter": (("simulate", "square", "--set", "mass=nan"), "parameters.mass.value: found nan; allowed: "),  # noqa: E501
    "impossible mass": (("simulate", "square", "--set", "mass=-1"), "strider.xml: "),
    "unknown gait": (("simulate", "sqare"), "sqare: neither a baseline nor a gait file nor an exported table "),  # noqa: E501
    "missing gait file": (("simulate", "gone.toml"), "gone.toml: neither a baseline nor a gait file"),
    "CSV nowhere": (("simulate", "square", "--csv", "gone/walk.csv"), "gone/walk.csv: cannot be written: No such"),  # noqa: E501
    "sweep over nothing": (("sweep", "--over", "period_s"), "--over: found 'period_s'; allowed: NAME=V1,V2,… with"),  # noqa: E501
    "sweep over a word": (("sweep", "--over", "period_s=slow"), "--over: found 'period_s=slow'; allowed: NAME="),  # noqa: E501
    "sweep over NaN": (("sweep", "--over", "period_s=1,nan"), "--over: found 'period_s=1,nan'; allowed: NAME="),  # noqa: E501
    "sweep over an unknown": (("sweep", "--over", "period=1"), "--over: unknown parameter 'period'; known: period_s,"),  # noqa: E501
    "sweep to a negative period": (
        ("sweep", "--over", "period_s=1,-1"),
        "--over period_s=-1: period_s: found -1.0; allowed: greater than or equal to 0.001",
    ),
    "sweep out of the travel": (
        ("sweep", "--over", "rear.offset_deg=80"),
        "--over rear.offset_deg=80: channels.rear: found 'targets from 80 to 120 degrees'; allowed: the servo's",  # noqa: E501
    ),
    "compare with a negative seed": (("compare", "square", "--seed", -1), "--seed: found -1; allowed: 0 or more"),  # noqa: E501
    "model nowhere": (("model", "--out", "gone/robot.xml"), "gone/robot.xml: cannot be written: No such file"),  # noqa: E501
    "dt of 0": (
        ("command", "square", "--dt", 0, "--duration", 1, "--out", "c.csv"),
        "--dt: found 0.0; allowed: a positive number of seconds",
    ),
    "endless duration": (
        ("command", "square", "--dt", 1, "--duration", "inf", "--out", "c.csv"),
        "--duration: found inf; allowed: a positive number of seconds",
    ),
    "too many rows": (
        ("command", "square", "--dt", 1e-9, "--duration", 1, "--out", "c.csv"),
        "--dt: found 1e-09; ",
    ),
    "more rows than a number can say": (
        ("command", "square", "--dt", 1e-310, "--duration", 1e10, "--out", "c.csv"),
        "--dt: found 1e-310; ",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_OPTIONS)
def test_a_bad_option(gaitopt: Run, name: str) -> None:
    (command, *options), message = BAD_OPTIONS[name]
    assert message in refused(gaitopt, command, STRIDER, *options)


@pytest.mark.parametrize("command", ["optimise", "sweep"])
def test_an_output_folder_that_cannot_be_used(gaitopt: Run, finished: Path, command: str) -> None:
    options = ("--over", "period_s=1") if command == "sweep" else ("--budget", 2, "--quiet")

    def out(path: Path | str) -> str:
        return refused(gaitopt, command, STRIDER, *options, "--out", path)

    Path("file").write_text("")
    assert out("file") == (
        "--out: file: cannot be made: File exists"
        if command == "optimise"
        else "--out: file is a file; allowed: a new or an empty folder"
    )
    assert out("file/run") == "--out: file/run: cannot be made: Not a directory"
    Path("full").mkdir()
    Path("full/thesis.tex").write_text("years of work")
    assert out("full") == "--out: full is not empty; allowed: a new or an empty folder"
    assert Path("full/thesis.tex").read_text() == "years of work"
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    assert out(finished) == (
        f"--out: {finished} already holds a run; choose another folder, or --resume {finished}"
        if command == "optimise"
        else f"--out: {finished} is not empty; allowed: a new or an empty folder"
    )
    assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before


def test_two_runs_into_one_folder_are_refused(gaitopt: Run, strider: Problem, tmp_path: Path) -> None:
    with RunFolder.create(tmp_path / "run", strider, Request(budget=2)):
        assert refused(gaitopt, "optimise", STRIDER, "--resume", tmp_path / "run") == (
            f"{tmp_path / 'run'}: another run is working in this folder"
        )
        assert "already holds a run" in refused(gaitopt, "optimise", STRIDER, "--out", tmp_path / "run")
