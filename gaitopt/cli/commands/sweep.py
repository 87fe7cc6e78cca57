"""`gaitopt sweep`: one gait over a range of one parameter."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_executor, add_json, add_posterior, add_problem, add_run_folder, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    parser.add_argument("gait", metavar="GAIT", nargs="?", help="the first baseline by default")
    about = "period_s, CHANNEL.KEY or a parameter"
    parser.add_argument("--over", metavar="NAME=V1,V2,…", required=True, help=about)
    add_posterior(parser, "some of its robots are simulated, too")
    add_run_folder(parser)
    add_json(parser)
    add_executor(parser)


def run(options: Options) -> None:
    """Sweep, and print a row for each value."""
    from gaitopt.cli.display import print_report, print_rows, speed_over_robots
    from gaitopt.jobs.outputs import NUMBERED
    from gaitopt.jobs.sweep import sweep
    from gaitopt.report.words import ON_NOMINAL

    swept = sweep(
        problem_of(options),
        options.gait,
        over=options.over,
        executor=options.executor,
        workers=options.workers,
        out=options.out or NUMBERED,
        posterior=options.posterior,
    )
    rows = [row.to_dict() for row in swept.rows]
    if options.json:
        print_json({"rows": rows})
    else:
        print_rows([row.nominal | speed_over_robots(row) for row in swept.rows])
        if any("speed_m_s" in row.metrics for row in swept.rows):
            say(f"One rollout at each value {ON_NOMINAL}")
        print_report(swept.folder)


COMMAND = Command(
    name="sweep",
    summary="simulate a gait over a range of one parameter",
    example="gaitopt sweep arcfold --over period_s=4,2,1,0.5",
    add_options=add_options,
    run=run,
)
