"""`gaitopt film`: a synthetic phone films the tagged robot, to plan where to put the camera."""

from __future__ import annotations

import argparse
from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_gait, add_json, add_problem, add_quiet, add_seed, problem_of
from gaitopt.core.numbers import number

_USUAL = (0.5, 45.0, 15.0)
"""Place of the camera; see `--camera`. High, as angles of a tag that is seen straight on are known worst."""


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add_gait(parser)
    add = parser.add_argument
    add("--out", type=Path, metavar="F.mp4", required=True, help="the film")
    add(
        "--camera",
        type=_camera,
        default=_USUAL,
        metavar="M[,HEIGHT[,BACK]]",
        help="distance from the tags, m; height above the floor and how far back it stands, degrees "
        f"(default: {','.join(f'{part:g}' for part in _USUAL)})",
    )
    add("--fps", type=float, default=30.0, metavar="N", help="frames a second (default: %(default)g)")
    add("--seconds", type=float, metavar="S", help="length (default: half a second of rest and a cycle)")
    add("--hand", action="store_true", help="the phone is held in the hand, not on a stand")
    add("--size-mm", type=float, metavar="MM", help="edge of the robot's tags (default: the problem's)")
    add_seed(parser, "noise and shake")
    add_quiet(parser)
    add_json(parser)


def _camera(text: str) -> tuple[float, float, float]:
    try:
        given = tuple(number(part) for part in text.split(","))
    except ValueError:
        given = ()
    if not 1 <= len(given) <= 3:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: M, M,HEIGHT or M,HEIGHT,BACK")
    distance, height, back = (*given, *_USUAL[len(given) :])
    return distance, height, back


def run(options: Options) -> None:
    """Make the film, and print how well it is tracked."""
    from gaitopt.cli.progress import display
    from gaitopt.jobs.rehearsal import Camera, RehearsalOptions, rehearse

    how = RehearsalOptions(
        Camera(*options.camera), options.fps, options.seconds, options.hand, options.size_mm, options.seed
    )
    with display(options.quiet or options.json) as show:
        done = rehearse(problem_of(options), options.gait, options.out, how, show)
    if options.json:
        print_json(done.to_dict())
        return
    say(done.found.sentence())
    for line in done.lines():
        say(f"  {line}")


COMMAND = Command(
    name="film",
    summary="film a tagged robot with a synthetic phone: where to put the camera",
    example="gaitopt film arcfold square-0.5s --camera 0.7 --seconds 0.7 --out plan.mp4",
    add_options=add_options,
    run=run,
)
