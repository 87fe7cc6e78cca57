"""`gaitopt runs`: run folders with speed, date and state."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json


def add_options(parser: Parser) -> None:
    """Add the options."""
    about = "run folders, or folders that hold some (default: here and results/runs)"
    parser.add_argument("folders", type=Path, metavar="DIR", nargs="*", help=about)
    about = "also write a page with all of them side by side"
    parser.add_argument("--html", type=Path, metavar="FILE", help=about)
    add_json(parser)


def run(options: Options) -> None:
    """Print the runs, the latest last."""
    from gaitopt.cli.display import print_runs
    from gaitopt.jobs.runs import list_runs

    runs = list_runs(options.folders, options.html)
    if options.json:
        print_json({"rows": [row.to_dict() for row in runs]})
        return
    print_runs(runs)
    if options.html is not None:
        say(f"page: {options.html}")


COMMAND = Command(
    name="runs",
    summary="list run folders with speed, date and state",
    example="gaitopt runs --html runs.html",
    add_options=add_options,
    run=run,
)
