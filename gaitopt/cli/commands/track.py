"""`gaitopt track`: films of a tagged robot to a data set."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import GAIT, add_json, add_quiet, pair, problem_of
from gaitopt.core.numbers import number


def add_options(parser: Parser) -> None:
    """Add the options."""
    add = parser.add_argument
    add("films", type=Path, metavar="FILM", nargs="+", help="films of the robot, each a trial: mp4, mov, …")
    add("--problem", metavar="PROBLEM", required=True, help="the robot: folder, TOML, or bundled name")
    about = f"the commanded gait ({GAIT}); one for all films, or one for each"
    add("--gait", action="append", metavar="GAIT", required=True, help=about)
    add("--out", type=Path, metavar="DATASET", required=True, help="the new data set's folder")
    add(
        "--tag",
        dest="tags",
        action="append",
        default=[],
        type=pair("ID=SITE"),
        metavar="ID=SITE",
        help="where a tag sits, beside the problem's [tags]; ID=floor for one on the floor; may be repeated",
    )
    add("--size-mm", type=float, metavar="MM", help="edge of the black square of these tags (default: 20)")
    add(
        "--ruler-mm",
        type=float,
        default=100.0,
        metavar="MM",
        help="what the printed ruler of 100 mm measures (default: %(default)g)",
    )
    _add_sync(parser)
    _add_untagged(parser)
    add(
        "--readout-ms",
        type=float,
        metavar="MS",
        help="how much later the phone reads a picture's last row than its first; most films show it",
    )
    about = "write a page into this folder: tracks, gaps, noise, advice, and the films with the tags drawn in"
    add("--report", type=Path, metavar="DIR", help=about)
    parser.set_defaults(parameters=[])
    add_quiet(parser)
    add_json(parser)


def _add_sync(parser: Parser) -> None:
    """Add the options that say, or show, when the gait begins: of one kind, one for all films or one each."""
    group = parser.add_mutually_exclusive_group()
    for name, kind, metavar, about in (
        ("at", float, "S", "the gait begins at this time in the film; one for all films, or one each"),
        ("frame", int, "N", "the gait begins in this picture; the first one is 0"),
        ("led", _dot, "X,Y", "a lamp at this pixel of the first picture lights up when the gait begins"),
        ("tag", int, "ID", "this tag, of the robot or on what starts it, begins to move with the gait"),
    ):
        group.add_argument(
            f"--sync-{name}", action="append", default=[], type=kind, metavar=metavar, help=about
        )


def _add_untagged(parser: Parser) -> None:
    """Add the options for films without tags."""
    add = parser.add_argument
    add(
        "--dot",
        dest="points",
        action="append",
        default=[],
        type=_dot,
        metavar="X,Y",
        help="without tags: follow the coloured dot at this pixel of the first picture; one, or one each",
    )
    add(
        "--patch",
        dest="points",
        action="append",
        type=_patch,
        metavar="X,Y,W,H",
        help="without tags: follow this patch of the first picture (upper left corner, width, height)",
    )
    add(
        "--length",
        dest="lengths",
        action="append",
        default=[],
        type=_length,
        metavar="X1,Y1,X2,Y2,MM",
        help="without tags: two points of the first picture, in the direction of travel, and their distance",
    )
    add("--view", default="side", help="without tags: side (default) or top, from where the camera looks")


def _numbers(text: str, allowed: str) -> list[float]:
    try:
        found = [number(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != allowed.count(",") + 1 or not all(map(math.isfinite, found)):
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: {allowed}")
    return found


def _dot(text: str) -> tuple[float, ...]:
    return tuple(_numbers(text, "X,Y in pixels"))


def _patch(text: str) -> tuple[float, ...]:
    return tuple(_numbers(text, "X,Y,W,H in pixels"))


def _length(text: str) -> tuple[float, ...]:
    return tuple(_numbers(text, "X1,Y1,X2,Y2,MM: two points in pixels and their distance"))


def run(options: Options) -> None:
    """Track the films, and print what was found."""
    from gaitopt.cli.progress import display
    from gaitopt.jobs.track import TrackOptions, marks, points, track

    unsaid = TrackOptions(
        tags={number: None if site == "floor" else site for number, site in options.tags},
        size_mm=options.size_mm,
        ruler_mm=options.ruler_mm,
        sync=marks(options.sync_at, options.sync_frame, options.sync_led, options.sync_tag),
        readout_ms=options.readout_ms,
        points=points(options.points, options.lengths, options.view),
    )
    with display(options.quiet or options.json) as show:
        problem = problem_of(options)
        done = track(options.films, problem, options.gait, options.out, unsaid, show, options.report)
    if options.json:
        print_json(done.to_dict())
        return
    for film in done.films:
        say(film.sentence())
        for line in film.lines():
            say(f"  {line}")
    for defect in done.defects:
        say(f"- {defect.trial}: {defect.name}: {defect.message}")
    say(f"data set: {done.folder}")
    if options.report is not None:
        say(f"page: {options.report / 'report.html'}")


COMMAND = Command(
    name="track",
    summary="measure films of a tagged robot, and write a data set",
    example="gaitopt track phone.mp4 --problem arcfold --gait square-0.5s --out filmed",
    add_options=add_options,
    run=run,
)
