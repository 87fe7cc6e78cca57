"""`gaitopt effects`: the library of effects."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json
from gaitopt.cli.options import add_json, add_problem, problem_of
from gaitopt.core.errors import GaitoptError


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser, needed=False)
    add_json(parser)


def run(options: Options) -> None:
    """Print the effects, and which of them apply to a problem."""
    from gaitopt.cli.display import print_effects
    from gaitopt.jobs.effects import list_effects

    if options.problem is None and options.parameters:
        raise GaitoptError("--set: found no PROBLEM to set a parameter of")
    rows = list_effects(None if options.problem is None else problem_of(options))
    print_json({"rows": [row.to_dict() for row in rows]}) if options.json else print_effects(rows)


COMMAND = Command(
    name="effects",
    summary="list the effects that a model may lack",
    example="gaitopt effects arcfold",
    add_options=add_options,
    run=run,
)
