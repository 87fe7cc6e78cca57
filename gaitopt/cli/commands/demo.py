"""`gaitopt demo`: a first look in under a minute."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.commands.optimise import print_run, print_stopped
from gaitopt.cli.lines import say
from gaitopt.cli.options import add_json, add_quiet, add_run_folder


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_run_folder(parser)
    add_json(parser)
    add_quiet(parser)


def run(options: Options) -> None:
    """Search briefly, and print the result."""
    from gaitopt.cli import demo
    from gaitopt.cli.progress import display
    from gaitopt.jobs.optimise import optimise
    from gaitopt.jobs.outputs import NUMBERED, Stopped

    try:
        with display(options.quiet or options.json) as on_progress:
            done = optimise(
                demo.demo_problem(),
                budget=demo.BUDGET,
                full=True,
                sensitivity=False,
                out=options.out or NUMBERED,
                on_progress=on_progress,
            )
    except Stopped as stop:
        print_stopped(stop)
        raise
    print_run(done, options.json)
    if not options.json:
        say("This was a brief search over few scenarios. For the real thing, type: gaitopt optimise arcfold")


COMMAND = Command(
    name="demo",
    summary="a first look in under a minute",
    description="Search a better gait for ArcFold, briefly, and write the report.",
    example="gaitopt demo",
    add_options=add_options,
    run=run,
)
