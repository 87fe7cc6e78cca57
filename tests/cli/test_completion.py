"""Completion of commands and options in a shell."""

import shlex
import shutil
import subprocess

import pytest

from gaitopt.cli import app as cli
from gaitopt.cli.completion import SHELLS, completion_script
from gaitopt.core.errors import GaitoptError


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_knows_every_command(shell: str) -> None:
    script = completion_script(cli.build_parser(), shell)
    assert all(name in script for name in ("optimise", "simulate", "export", "budget", "video", "score"))


def test_completion_of_an_unknown_shell() -> None:
    with pytest.raises(GaitoptError, match="bash, zsh, fish"):
        completion_script(cli.build_parser(), "csh")


def completed(*words: str) -> list[str]:
    """What bash offers for the last of some words, in an empty folder."""
    script = completion_script(cli.build_parser(), "bash")
    typed = f"COMP_WORDS=({shlex.join(words)}); COMP_CWORD={len(words) - 1}"
    lines = f'{script}\n{typed}; _gaitopt; printf "%s\\n" "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", lines], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("opt",), ["optimise"]),
        (("check", "quad"), ["quadruped"]),
        (("simulate", "arcfold", "square-"), ["square-4s", "square-2s", "square-1s", "square-0.5s"]),
        (("simulate", "quadruped", "tr"), ["trot"]),
        (("simulate", "arcfold", "run", "--beside", "square-1"), ["square-1s"]),
        (("optimise", "arcfold", "--method", "cma"), ["cma-es"]),
        (("optimise", "arcfold", "--bud"), ["--budget"]),
        (("export", "arcfold", "square-1s", "--format", "micro"), ["micropython"]),
        (("export", "arcfold", "square-1s", "--board", "esp32-c"), ["esp32-c3"]),
        (("check", "arcfold", "--executor", "ser"), ["serial"]),
        (("campaign", "st"), ["status"]),
        (("completion", "f"), ["fish"]),
    ],
)
def test_bash_completes_commands_options_and_their_values(words: tuple[str, ...], offered: list[str]) -> None:
    assert completed("gaitopt", *words) == offered


def test_fish_completes_the_gaits_of_the_problem_that_was_typed() -> None:
    script = completion_script(cli.build_parser(), "fish")
    line = next(line for line in script.splitlines() if "seen_subcommand_from simulate; and" in line)
    assert "contains -- arcfold (commandline -opc)" in line
    assert line.endswith("-a 'square-4s square-2s square-1s square-0.5s'")
