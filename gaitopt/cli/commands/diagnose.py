"""`gaitopt diagnose`: where measured trials and simulation differ, and why."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say, say_aside
from gaitopt.cli.options import (
    add_executor,
    add_json,
    add_problem,
    add_quiet,
    add_run_folder,
    problem_of,
    words_of,
)

if TYPE_CHECKING:
    from gaitopt.jobs.diagnose import DiagnosisRun
    from gaitopt.jobs.outputs import Stopped


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add = parser.add_argument
    add("dataset", type=Path, metavar="DATASET", help="folder with dataset.toml and its trials")
    add("--seed", type=int, metavar="S", help="seed of all randomness (default: 1)")
    add("--effects", metavar="A,B,…", help="try only these effects (default: all that apply)")
    add("--full", action="store_true", help="add a film with the measured marker to the report")
    add("--resume", type=Path, metavar="DIR", help="continue an interrupted diagnosis")
    add_run_folder(parser)
    add_json(parser)
    add_quiet(parser)
    add_executor(parser, "auto", "processes for logged commands, else threads")


def run(options: Options) -> None:
    """Diagnose or continue a diagnosis, and print the answer."""
    from gaitopt.cli.progress import display
    from gaitopt.jobs.diagnose import diagnose, is_finished
    from gaitopt.jobs.outputs import NUMBERED, Stopped

    resumed = options.resume
    try:
        with display(options.quiet or options.json) as on_progress:
            done = diagnose(
                None if is_finished(resumed) else problem_of(options),
                options.dataset,
                effects=words_of(options.effects),
                seed=1 if options.seed is None else options.seed,
                full=options.full,
                executor=options.executor,
                workers=options.workers,
                out=options.out if resumed else options.out or NUMBERED,
                resume=resumed,
                on_progress=on_progress,
            )
    except Stopped as stop:
        _print_stopped(stop, options)
        raise
    _print_run(done, options.json)


def _print_run(done: DiagnosisRun, as_json: bool) -> None:
    from gaitopt.cli.display import print_report

    if as_json:
        print_json(done.content)
        return
    say(done.answer)
    for sentence in done.explanation:
        say(f"- {sentence}")
    print_report(done.folder)


def _print_stopped(stop: Stopped, options: Options) -> None:
    """Say how to continue a diagnosis that Ctrl-C or SIGTERM ended."""
    words = ["gaitopt", "diagnose", options.problem, options.dataset, "--resume", stop.folder]
    if options.effects:
        words += ["--effects", options.effects]
    if options.seed is not None:
        words += ["--seed", options.seed]
    for name, value in options.parameters:
        words += ["--set", f"{name}={value!r}"]
    line = " ".join(shlex.quote(str(word)) for word in words)
    say_aside(f"gaitopt: stopped after {stop.done}; go on with: {line}")


COMMAND = Command(
    name="diagnose",
    summary="compare measured trials with the simulation: where the gap lies and what causes it",
    example="gaitopt diagnose arcfold trials",
    add_options=add_options,
    run=run,
)
