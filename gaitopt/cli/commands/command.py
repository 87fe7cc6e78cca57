"""`gaitopt command`: what is sent to each actuator."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_gait, add_json, add_problem, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add_gait(parser, logs=True)
    add = parser.add_argument
    add("--dt", type=float, metavar="S", required=True, help="time between rows, s")
    add("--duration", type=float, metavar="S", required=True, help="rows end before this, s")
    add("--out", type=Path, metavar="F.csv", required=True, help="where to write it")
    add_json(parser)


def run(options: Options) -> None:
    """Write the table, and print where."""
    from gaitopt.jobs.command import command

    problem = problem_of(options)
    table = command(problem, options.gait, dt=options.dt, duration=options.duration, out=options.out)
    if options.json:
        print_json({"file": str(options.out), "rows": len(table.time), "channels": list(table.targets)})
    else:
        say(options.out)


COMMAND = Command(
    name="command",
    summary="write the targets that are sent to each actuator by a gait or a log of commands",
    example="gaitopt command arcfold square-1s --dt 0.01 --duration 2 --out command.csv",
    add_options=add_options,
    run=run,
)
