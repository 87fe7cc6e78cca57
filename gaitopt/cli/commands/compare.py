"""`gaitopt compare`: gaits side by side over the same scenarios."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import (
    add_executor,
    add_json,
    add_posterior,
    add_problem,
    add_report_folder,
    add_seed,
    problem_of,
)


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    about = "baselines, gait files, exported tables or run folders"
    parser.add_argument("gaits", metavar="GAIT", nargs="+", help=about)
    add_seed(parser, "the scenarios")
    add_posterior(parser, "each scenario has one of its robots")
    add_report_folder(parser)
    add_json(parser)
    add_executor(parser)


def run(options: Options) -> None:
    """Compare, and print a row and a sentence for each gait."""
    from gaitopt.cli.display import print_comparison, print_report
    from gaitopt.jobs.compare import compare
    from gaitopt.report.words import compared_basis, verdicts

    rows = compare(
        problem_of(options),
        options.gaits,
        seed=options.seed,
        executor=options.executor,
        workers=options.workers,
        out=options.out,
        posterior=options.posterior,
    )
    if options.json:
        print_json({"rows": [row.to_dict() for row in rows]})
        return
    print_comparison(rows)
    say(compared_basis(rows))
    for sentence in verdicts(rows):
        say(sentence)
    print_report(options.out)


COMMAND = Command(
    name="compare",
    summary="compare gaits over the same scenarios, with intervals",
    example="gaitopt compare arcfold square-2s square-1s",
    add_options=add_options,
    run=run,
)
