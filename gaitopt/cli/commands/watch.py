"""`gaitopt watch`: a run that goes on, in a browser on this machine."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import say


def add_options(parser: Parser) -> None:
    """Add the options."""
    parser.add_argument("folder", type=Path, metavar="RUN", help="run folder of a search that is running")
    about = "port of the page on this machine (default: any free one)"
    parser.add_argument("--port", type=int, default=0, metavar="N", help=about)


def run(options: Options) -> None:
    """Print the address of the page, wait for the end of the run, and print how it ended."""
    from gaitopt.cli.display import print_runs
    from gaitopt.jobs.watch import watch

    def announce(address: str) -> None:
        say(f"open {address} in a browser on this machine; Ctrl-C ends watching, not the run")

    print_runs([watch(options.folder, port=options.port, on_address=announce)])


COMMAND = Command(
    name="watch",
    summary="show a search that is running in a browser on this machine",
    example="gaitopt watch results/runs/arcfold-001",
    add_options=add_options,
    run=run,
)
