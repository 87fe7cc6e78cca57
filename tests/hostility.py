"""What tests of hostile files share."""

import ast
import os
import signal
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from helpers import STRIDER, edited, problem_folder

import gaitopt
from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem, load_problem

PACKAGE = Path(gaitopt.__file__).parent
CUBE = b"v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def refused(call: Callable[[], object]) -> str:
    """What the error says: a line."""
    with pytest.raises(GaitoptError) as caught:
        call()
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) < 3000
    return text


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str]:
    """Run a command in this process; return its exit code and what it said on standard error."""
    capsys.readouterr()
    code = cli.main([str(argument) for argument in arguments])
    err = capsys.readouterr().err
    assert err.count("\n") == (code != 0)
    return code, err


def with_element(folder: Path, element: str, where: str = "</worldbody>") -> Problem:
    problem_folder(folder, STRIDER)
    edited(folder / "strider.xml", where, where + element)
    return load_problem(folder)


@contextmanager
def within(seconds: int) -> Iterator[None]:
    """Fail where something waits, or works without end, in Python."""

    def fail(*_: object) -> None:
        pytest.fail(f"it takes more than {seconds} s")  # no OSError, which could be taken for the file's

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def make_device(path: Path) -> Path:
    """Make a device of one's own that is always empty: attacks never touch the machine's devices.

    Code that fails such a test would replace ``/dev/null`` itself, where the tests run as root.
    """
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("only root may make a device")
    return path


def contents(folder: Path) -> dict[str, tuple[str, int]]:
    """The text and the time stamp of each file in a folder."""
    return {path.name: (path.read_text(), path.stat().st_mtime_ns) for path in folder.iterdir()}


@cache
def trees() -> list[tuple[str, ast.Module]]:
    """Every source file of the package, parsed."""
    paths = sorted(PACKAGE.rglob("*.py"))
    assert len(paths) > 60
    return [(str(path), ast.parse(path.read_text())) for path in paths]
