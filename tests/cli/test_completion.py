"""Completion of commands and options in a shell."""

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
