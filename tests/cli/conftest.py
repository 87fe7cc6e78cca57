"""Commands run in this process, and a finished run."""

from pathlib import Path

import pytest
from commandline import Run
from helpers import STRIDER

from gaitopt.cli import app as cli


@pytest.fixture
def gaitopt(capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command; return its exit code, standard output and standard error."""

    def run(*arguments: object) -> tuple[int, str, str]:
        capfd.readouterr()
        code = cli.main([str(argument) for argument in arguments])
        return code, *capfd.readouterr()

    return run


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished run of the strider."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    code = cli.main(
        ["optimise", str(STRIDER), "--budget", "12", "--seed", "5", "--out", str(folder), "--quiet"]
    )
    assert code == 0
    return folder
