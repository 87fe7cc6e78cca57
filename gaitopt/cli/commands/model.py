"""`gaitopt model`: the nominal model as one MJCF."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import say
from gaitopt.cli.options import add_problem, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    parser.add_argument("--out", type=Path, metavar="F.xml", required=True, help="where to write it")


def run(options: Options) -> None:
    """Write the model, and print where."""
    from gaitopt.jobs.model import model

    model(problem_of(options), options.out)
    say(options.out)


COMMAND = Command(
    name="model",
    summary="write the nominal model as one MJCF",
    example="gaitopt model arcfold --out arcfold.xml",
    add_options=add_options,
    run=run,
)
