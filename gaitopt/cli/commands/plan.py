"""`gaitopt plan`: gaits of the reduced planar model, without MuJoCo."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json, add_problem, add_seed, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add_seed(parser, "the random starts")
    add_json(parser)


def run(options: Options) -> None:
    """Plan, and print the planned gaits and the baselines."""
    from gaitopt.cli.display import print_rows
    from gaitopt.jobs.plan import plan
    from gaitopt.plan.plan import MISSES

    problem = problem_of(options)
    found = plan(problem, seed=options.seed)
    if options.json:
        print_json(found.to_dict())
        return
    for line in found.dropped:
        say(f"dropped: {line}")
    planned = [(e.gait.name, e.gait.period_s, e.predicted_speed_m_s) for e in found.elites]
    known = [(name, problem.baselines[name].period_s, speed) for name, speed in found.baselines.items()]
    keys = ("name", "period_s", "predicted_speed_m_s")
    print_rows([dict(zip(keys, row, strict=True)) for row in [*planned, *known]])
    for name, creep in found.creep.items():
        say(f"{name}: smoothed friction changes the predicted speed by {1e3 * creep:+.2f} mm/s")
    say(MISSES)


COMMAND = Command(
    name="plan",
    summary="plan gaits with the reduced planar model, without MuJoCo's steps",
    example="gaitopt plan arcfold",
    add_options=add_options,
    run=run,
)
