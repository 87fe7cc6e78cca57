"""The program: arguments in, a command's work, exit code out."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from contextlib import chdir
from importlib.metadata import version
from pathlib import Path

from gaitopt.cli.command import Parser
from gaitopt.cli.commands import COMMANDS
from gaitopt.cli.lines import say_aside
from gaitopt.core.errors import GaitoptError
from gaitopt.core.interrupts import interrupts_between_imports, was_terminated
from gaitopt.robot.warnings import silence_warnings

DONE, STATED_PROBLEM, INTERRUPTED, TERMINATED = 0, 1, 130, 143


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    os.environ.setdefault("MPLBACKEND", "Agg")  # a command draws into files, never into windows
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a letter that a terminal cannot show is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    try:
        with interrupts_between_imports():
            words = sys.argv[1:] if arguments is None else list(arguments)
            options = build_parser().parse_args(_canonical(words))
            silence_warnings()
            _ignore_settings_here()
            options.run(options)
    except SystemExit as stop:
        return int(stop.code or 0)
    except GaitoptError as problem:
        return _stated(str(problem))
    except KeyboardInterrupt as stop:
        terminated = was_terminated(stop)
        say_aside(f"gaitopt: {'terminated' if terminated else 'interrupted'}")
        return TERMINATED if terminated else INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader has gone; no output can reach it
        return STATED_PROBLEM
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        return _stated(str(GaitoptError(f"{where}{problem.strerror or problem}")))
    except MemoryError:
        return _stated("out of memory")
    return DONE


def _ignore_settings_here() -> None:
    """Load Matplotlib from elsewhere if the current folder has a file of its settings: it would read that.

    The folder may be a stranger's, the file a pipe. Settings of the user are in the user's own folder.
    """
    if os.path.lexists("matplotlibrc"):
        with chdir(Path(__file__).parent):
            import matplotlib  # noqa: F401


def _stated(problem: str) -> int:
    say_aside(f"gaitopt: {problem}")
    return STATED_PROBLEM


def _canonical(arguments: list[str]) -> list[str]:
    """Accept the other spelling of the main command."""
    return ["optimise", *arguments[1:]] if arguments[:1] == ["optimize"] else arguments


def build_parser() -> Parser:
    """Return the parser of every command."""
    parser = Parser(
        prog="gaitopt",
        description="Find better gaits for small robots, compare them with hand-tuned ones.",
        epilog="example: gaitopt optimise arcfold",
    )
    parser.add_argument("--version", action="version", version=f"gaitopt {version('gaitopt')}")
    parser.set_defaults(program=parser)
    parser.add_commands(COMMANDS, "commands", dest="command", metavar="COMMAND")
    return parser
