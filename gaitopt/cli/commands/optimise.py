"""`gaitopt optimise`: baselines, search, verification and report."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say, say_aside
from gaitopt.cli.options import (
    add_executor,
    add_json,
    add_posterior,
    add_problem,
    add_quiet,
    add_run_folder,
    problem_of,
)
from gaitopt.core.errors import GaitoptError

if TYPE_CHECKING:
    from gaitopt.jobs.optimise import OptimiseRun
    from gaitopt.jobs.outputs import Stopped


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add = parser.add_argument
    add("--budget", type=int, metavar="N", help="gaits to evaluate (default: 600)")
    add("--seed", type=int, metavar="S", help="seed of all randomness (default: 1)")
    about = "default, or one solver alone, such as cma-es or nelder-mead"
    add("--method", metavar="NAME", values="METHOD", help=about)
    add("--warm-start", action=argparse.BooleanOptionalAction, default=None, help="start from planned gaits")
    about = "spend half of the budget on a front of speed against cost of transport"
    add("--pareto", action="store_const", const=True, help=about)
    add("--resume", type=Path, metavar="DIR", help="continue an interrupted run")
    add("--full", action="store_true", help="add a film and sensitivities to the report")
    add_posterior(parser, "each scenario has one of its robots")
    add_run_folder(parser)
    add_json(parser)
    add_quiet(parser)
    add_executor(parser)


def run(options: Options) -> None:
    """Search or continue a search, and print the result."""
    from gaitopt.cli.progress import display
    from gaitopt.jobs.optimise import holds_run, optimise
    from gaitopt.jobs.outputs import NUMBERED, Stopped

    resumed = options.resume
    if resumed is None and holds_run(options.problem) and not options.json:
        say_aside(
            f"a new search for the robot of a run, which --resume {shlex.quote(options.problem)} continues"
        )
    if resumed is not None and options.parameters:
        raise GaitoptError(f"--set: not with --resume, which takes it from {resumed}")
    try:
        with display(options.quiet or options.json) as on_progress:
            done = optimise(
                None if resumed else problem_of(options),
                budget=options.budget,
                seed=options.seed,
                method=options.method,
                warm_start=options.warm_start,
                pareto=options.pareto,
                full=options.full,
                executor=options.executor,
                workers=options.workers,
                out=options.out if resumed else options.out or NUMBERED,
                posterior=options.posterior,
                resume=resumed,
                on_progress=on_progress,
            )
    except Stopped as stop:
        print_stopped(stop)
        raise
    print_run(done, options.json)


def print_run(done: OptimiseRun, as_json: bool) -> None:
    """Print the result of a search."""
    from gaitopt.cli.display import print_margins, print_report, print_summary
    from gaitopt.report.words import answer_of, basis_of, reach_of

    if as_json:
        print_json(done.summary.to_dict())
    else:
        print_summary(done.summary)
        say(answer_of(done.summary))
        if basis := basis_of(done.summary):
            say(basis)
        if reach := reach_of(done.summary):
            say(reach)
        print_margins(done.summary)
        if done.summary.robots:
            say(f"Each scenario ran on one of {done.summary.robots} robots of a posterior.")
        print_report(done.folder)


def print_stopped(stop: Stopped) -> None:
    """Say how to continue a search that Ctrl-C or SIGTERM ended."""
    path = shlex.quote(str(stop.folder))
    say_aside(f"gaitopt: stopped after {stop.done}; go on with: gaitopt optimise {path} --resume {path}")


COMMAND = Command(
    name="optimise",
    summary="simulate the baselines, search for the best gait, verify it and write a report",
    example="gaitopt optimise arcfold --budget 600 --seed 1",
    add_options=add_options,
    run=run,
)
