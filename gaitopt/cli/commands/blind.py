"""`gaitopt blind make` and `gaitopt blind score`: sealed cases, and how good diagnoses of them are."""

from __future__ import annotations

from pathlib import Path

from gaitopt.blind.kinds import KINDS
from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_executor, add_json, add_problem, problem_of, words_of

_EXAMPLE = "gaitopt blind make arcfold --cases 10 --seed 1 --out cases"


def add_make_options(parser: Parser) -> None:
    """Add the options of ``blind make``."""
    add_problem(parser)
    add = parser.add_argument
    add("--cases", type=int, metavar="N", required=True, help="number of cases")
    add("--seed", type=int, default=1, help="seed of all randomness (default: 1)")
    add("--out", type=Path, metavar="DIR", required=True, help="their folder; existing cases in it are kept")
    add("--seconds", type=float, default=12.0, metavar="S", help="length of a trial (default: 12)")
    add("--gaits", metavar="A,B,…", help="baselines measured (default: all)")
    about = "what is measured (default: the marker and the first servo's joint)"
    add("--signals", metavar="A,B,…", help=about)
    add("--kind", choices=KINDS, help="make only this kind")
    add("--only", metavar="NAME", help="with --kind: plant this effect or disturbance")
    add_json(parser)
    add_executor(parser)


def make(options: Options) -> None:
    """Make cases, and print where they and their truth are."""
    from gaitopt.jobs.blind import blind_make

    made = blind_make(
        problem_of(options),
        options.cases,
        options.out,
        seed=options.seed,
        seconds=options.seconds,
        gaits=words_of(options.gaits),
        signals=words_of(options.signals),
        kind=options.kind,
        only=options.only,
        executor=options.executor,
        workers=options.workers,
    )
    if options.json:
        print_json(made.to_dict())
        return
    say(f"{len(made.kinds)} cases: {made.folder}; their truth: {made.sealed}")
    if made.faint:
        say(f"gap too small within their bounds, for some target or side: {', '.join(made.faint)}")


def add_score_options(parser: Parser) -> None:
    """Add the options of ``blind score``."""
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help="the folder that blind make made")
    about = "run folders, one for each case (default: DIR/diagnoses)"
    add("--diagnoses", type=Path, metavar="D", help=about)
    add_json(parser)
    add_executor(parser)


def score(options: Options) -> None:
    """Score diagnoses, and print the figures in words."""
    from gaitopt.blind.scoring import sentences
    from gaitopt.cli.progress import display
    from gaitopt.jobs.blind import blind_score

    with display(options.json) as on_progress:
        record = blind_score(
            options.folder,
            diagnoses=options.diagnoses,
            executor=options.executor,
            workers=options.workers,
            on_progress=on_progress,
        )
    if options.json:
        print_json(record.to_dict())
        return
    for sentence in sentences(record):
        say(sentence)


COMMAND = Command(
    name="blind",
    summary="make sealed cases, and score diagnoses on them",
    example=_EXAMPLE,
    actions=(
        Command(
            name="make",
            summary="make sealed cases",
            description="Make sealed cases: data sets whose cause only blind score reads.",
            example=_EXAMPLE,
            add_options=add_make_options,
            run=make,
        ),
        Command(
            name="score",
            summary="compare diagnoses with the sealed truth",
            description="Compare diagnoses with the sealed truth; cases without one are diagnosed first.",
            example="gaitopt blind score cases",
            add_options=add_score_options,
            run=score,
        ),
    ),
)
