"""`gaitopt correct`: a learnt servo in the problem of another robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json, add_problem, pair, problem_of

if TYPE_CHECKING:
    from gaitopt.jobs.correct import CorrectedServos


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add = parser.add_argument
    add("run_folder", metavar="RUN", help="run folder of a diagnosis, or a problem with effects")
    add("--out", type=Path, metavar="FILE.toml", help="problem file to write (default: NAME-corrected.toml)")
    add(
        "--channel",
        dest="channels",
        metavar="CHANNEL=BENCH_CHANNEL",
        action="append",
        default=[],
        type=pair("CHANNEL=BENCH_CHANNEL"),
        help="a channel of PROBLEM, and the channel of RUN that is its servo; may be repeated "
        "(default: channels of the same names, or all, where RUN has one)",
    )
    add_json(parser)


def run(options: Options) -> None:
    """Carry the servo over, and print each of its figures before and after."""
    from gaitopt.jobs.correct import correct_servos

    problem = problem_of(options)
    out = options.out or Path(f"{problem.name}-corrected.toml")
    done = correct_servos(problem, options.run_folder, channels=dict(options.channels), out=out)
    print_json(done.to_dict()) if options.json else _print(done)


def _print(done: CorrectedServos) -> None:
    from gaitopt.cli.display import print_table
    from gaitopt.core.quantities import figure

    head = ["channel", "figure", "unit", "old", "new"]
    rows = [[row.channel, row.figure, row.unit, figure(row.old), figure(row.new)] for row in done.rows]
    print_table(head, rows)
    for name, value in done.transfer.parameters.items():
        say(f"parameter {name} = {figure(value)}: no effect expresses it on this robot")
    for row in done.left_out:
        say(f"left out: {row.what}: {row.reason}")
    say(f"wrote {done.file}")


COMMAND = Command(
    name="correct",
    summary="write a servo that was learnt on a bench into the problem of a robot that uses it",
    example="gaitopt correct arcfold bench --out arcfold-corrected.toml",
    add_options=add_options,
    run=run,
)
