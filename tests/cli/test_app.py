"""Help, exit codes and unexpected errors of all commands."""

import math
from pathlib import Path

import pytest
from commandline import Run
from helpers import STRIDER

from gaitopt.optimise.executors import open_executor

COMMANDS = ["optimise", "simulate", "sweep", "compare", "check", "model", "command"]


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_an_example(gaitopt: Run, command: str) -> None:
    code, out, err = gaitopt(command, "--help")
    assert (code, err) == (0, "")
    assert f"example: gaitopt {command} " in out


def test_help_and_version(gaitopt: Run) -> None:
    code, out, _ = gaitopt("--help")
    assert code == 0
    assert all(command in out for command in COMMANDS)
    code, out, _ = gaitopt("--version")
    assert code == 0
    assert out.startswith("gaitopt ")


@pytest.mark.parametrize(
    "arguments",
    [
        ["optimse", "arcfold"],
        ["optimise"],
        ["optimise", "arcfold", "--budget", "many"],
        ["simulate", "arcfold"],
        ["simulate", "arcfold", "square-1s", "--set", "mass"],
        ["simulate", "arcfold", "square-1s", "--set", "mass=heavy"],
        ["sweep", "arcfold"],
        ["model", "arcfold"],
        ["simulate", "arcfold", "square-1s", "square-2s"],
        ["command", "arcfold", "square-1s"],
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(gaitopt: Run, arguments: list[str]) -> None:
    code, out, err = gaitopt(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("gaitopt: ")
    assert err.count("\n") == 1
    assert "--help" in err
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("command", [(), ("blind",), ("campaign",)])
def test_a_command_that_is_not_complete_shows_its_help(gaitopt: Run, command: tuple[str, ...]) -> None:
    code, out, err = gaitopt(*command)
    assert (code, err) == (0, "")
    assert out.startswith(" ".join(("usage: gaitopt", *command)))
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["optimse", "arcfold"], "optimise"),
        (["campaign", "nwe"], "new"),
        (["optimise", "arcfold", "--bugdet", "3"], "--budget"),
        (["blind", "make", "arcfold", "--cases", "1", "--out", "x", "--gatis=trot"], "--gaits"),
        (["export", "arcfold", "square-1s", "--format", "micropythn", "--out", "x"], "micropython"),
        (["optimise", "arcfld"], "arcfold"),
        (["simulate", "arcfold", "square-1"], "square-1s"),
        (["optimise", "arcfold", "--method", "cmaes"], "cma-es"),
        (["check", "arcfold", "--executor", "thraeds"], "threads"),
    ],
)
def test_a_slip_of_the_finger_names_what_was_meant(gaitopt: Run, arguments: list[str], meant: str) -> None:
    code, out, err = gaitopt(*arguments)
    assert code in (1, 2)
    assert out == ""
    assert f"(nearest: '{meant}')" in err
    assert err.count("\n") == 1
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("command", ["optimise", "optimize"])
def test_no_search_begins_by_accident(gaitopt: Run, command: str) -> None:
    """Nothing is searched without a problem, or for the help."""
    assert gaitopt(command)[0] == 2
    assert gaitopt(command, "--help")[0] == 0
    assert list(Path().iterdir()) == []


@pytest.mark.slow
def test_a_run_is_a_problem_of_another_search(gaitopt: Run, finished: Path) -> None:
    """The search says which command goes on with the run itself."""
    before = sorted(finished.rglob("*"))
    code, _, err = gaitopt("optimise", finished, "--budget", 1, "--no-warm-start", "--quiet")
    assert code == 0
    assert f"--resume {finished} continues" in err
    assert [path.name for path in Path("results/runs").iterdir()] == ["strider-001"]
    assert sorted(finished.rglob("*")) == before


def test_an_unexpected_error_is_not_hidden(gaitopt: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only stated problems become a line; a bug stays a traceback."""

    def broken(*_: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr("gaitopt.problem.problem.load_problem", broken)
    with pytest.raises(RuntimeError, match="a bug"):
        gaitopt("simulate", STRIDER, "square")


def test_executors_are_those_of_the_help(gaitopt: Run) -> None:
    for name in ("threads", "processes", "serial"):
        with open_executor(name, 1) as executor:
            assert executor.submit(math.sqrt, 4.0).result() == 2.0
        assert name in gaitopt("optimise", "--help")[1]
