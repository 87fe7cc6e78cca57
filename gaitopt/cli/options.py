"""Options that several commands share, with one meaning everywhere."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.cli.command import Options, Parser
from gaitopt.core.numbers import number

if TYPE_CHECKING:
    from gaitopt.problem.problem import Problem

GAIT = "baseline, gait file, exported table or run folder"


def add_problem(parser: Parser, *, needed: bool = True) -> None:
    """Add PROBLEM, and ``--set`` for its named parameters."""
    about = "folder, problem TOML, or bundled name"
    parser.add_argument("problem", metavar="PROBLEM", help=about, nargs=None if needed else "?")
    parser.add_argument(
        "--set",
        dest="parameters",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        type=_assignment,
        help="change a named model parameter; may be repeated",
    )


def add_gait(parser: Parser, logs: bool = False) -> None:
    """Add GAIT; if `logs`, a log of commands is one, too."""
    help_ = GAIT.replace(" or ", ", ") + ", or a CSV log of commands" if logs else GAIT
    parser.add_argument("gait", metavar="GAIT", help=help_)


def add_seed(parser: Parser, what: str = "all randomness") -> None:
    """Add ``--seed``."""
    parser.add_argument(
        "--seed", type=int, default=1, metavar="S", help=f"seed of {what} (default: %(default)s)"
    )


def add_executor(parser: Parser, default: str = "threads", about: str = "%(default)s") -> None:
    """Add ``--executor`` and ``--workers``.

    Args:
        parser: the command's parser.
        default: the executor where none is named.
        about: what the help says of the default.
    """
    parser.add_argument(
        "--executor",
        default=default,
        metavar="NAME",
        values="EXECUTOR",
        help="threads, processes, serial or dask://HOST:PORT, an address that you trust: what answers "
        f"there can run code here (default: {about})",
    )
    parser.add_argument("--workers", type=int, metavar="N", help="rollouts at once (default: all cores)")


def add_run_folder(parser: Parser) -> None:
    """Add ``--out`` of a command that always leaves a folder."""
    about = "run folder (default: a new one in results/runs)"
    parser.add_argument("--out", type=Path, metavar="DIR", help=about)


def add_report_folder(parser: Parser) -> None:
    """Add ``--out`` of a command that leaves a folder only where one is named."""
    about = "write a report with figures into this folder"
    parser.add_argument("--out", type=Path, metavar="DIR", help=about)


def add_posterior(parser: Parser, about: str) -> None:
    """Add ``--posterior``.

    Args:
        parser: the command's parser.
        about: what is done with its robots.
    """
    help_ = f"run folder of a diagnosis: {about}"
    parser.add_argument("--posterior", type=Path, metavar="DIR", help=help_)


def add_json(parser: Parser) -> None:
    """Add ``--json``."""
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")


def add_quiet(parser: Parser) -> None:
    """Add ``--quiet``."""
    parser.add_argument("--quiet", action="store_true", help="no progress display")


def problem_of(options: Options) -> Problem:
    """Return the problem that the options name, with the parameters that they set.

    Raises:
        GaitoptError: there is no such problem or parameter, or its files are wrong.
    """
    from gaitopt.problem.problem import load_problem

    return load_problem(options.problem, dict(options.parameters))


def words_of(text: str | None) -> list[str] | None:
    """Return the parts of a list written as ``A,B,…``; None where none is given."""
    return text.split(",") if text else None


def pair(form: str) -> Callable[[str], tuple[str, str]]:
    """Return what reads two words with ``=`` between them.

    Args:
        form: how they are written, such as ``CHANNEL=COLUMN``.
    """

    def read(text: str) -> tuple[str, str]:
        name, separator, other = text.partition("=")
        if not (name and separator and other):
            raise argparse.ArgumentTypeError(f"found {text!r}; allowed: {form}")
        return name, other

    return read


def _assignment(text: str) -> tuple[str, float]:
    name, separator, value = text.partition("=")
    try:
        if not separator:
            raise ValueError
        return name, number(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: NAME=VALUE with a number") from None
