"""`gaitopt tags`: fiducial tags to print."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add = parser.add_argument
    add("--out", type=Path, metavar="F.pdf", required=True, help="the PDF")
    add("--problem", metavar="PROBLEM", help="the robot: its [tags] say numbers, sizes and sites")
    add("--size-mm", type=float, metavar="MM", help="edge of a tag's black square (default: 20)")
    add("--ids", metavar="A-B", help="numbers of the tags (default: the problem's, else 0-7)")
    add("--paper", default="a4", help="a4 or letter (default: %(default)s)")
    parser.set_defaults(parameters=[])
    add_json(parser)


def run(options: Options) -> None:
    """Write the sheets, and print what is on them."""
    from gaitopt.jobs.tags import tags

    done = tags(
        options.out,
        ids=options.ids,
        size_mm=options.size_mm,
        paper=options.paper,
        problem=None if options.problem is None else problem_of(options),
    )
    if options.json:
        print_json(done.to_dict())
        return
    listed = ", ".join(f"{number} ({size:g} mm)" for number, size in done.tags.items())
    say(f"{done.path}: tags {listed}, and the floor sheet; {done.pages} pages")
    if done.note:
        say(done.note)
    say("print at 100 %, and measure the ruler: it must be 100 mm long")


COMMAND = Command(
    name="tags",
    summary="print tags by which a film of a robot is measured",
    example="gaitopt tags --problem arcfold --out tags.pdf",
    add_options=add_options,
    run=run,
)
