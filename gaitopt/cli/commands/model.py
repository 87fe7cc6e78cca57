"""`gaitopt model`: the nominal model as one MJCF."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json, add_problem, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    parser.add_argument("--out", type=Path, metavar="F.xml", required=True, help="where to write it")
    add_json(parser)


def run(options: Options) -> None:
    """Write the model, and print where."""
    from gaitopt.jobs.model import model

    problem = problem_of(options)
    model(problem, options.out)
    left_out = list(problem.file.effects)
    if options.json:
        print_json({"file": str(options.out), "left_out": left_out})
        return
    say(options.out)
    if left_out:
        say(f"left out: effects that act beside the model: {', '.join(left_out)}")


COMMAND = Command(
    name="model",
    summary="write the nominal model as one MJCF",
    example="gaitopt model arcfold --out arcfold.xml",
    add_options=add_options,
    run=run,
)
