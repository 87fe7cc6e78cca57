"""`gaitopt import`: recordings of tracking programs and logs of robots to a data set."""

from __future__ import annotations

import argparse
from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import GAIT, add_json, pair
from gaitopt.core.numbers import number


def add_options(parser: Parser) -> None:
    """Add the options."""
    add = parser.add_argument
    about = (
        "exports of Tracker, DeepLabCut, SLEAP, Kinovea; CSV; JSON lines; folders of LeRobot data sets. In "
        "a log, time is t_s or timestamp; commands are target.NAME_rad (_deg, _us), blank where unpowered; "
        "what was measured is joint.NAME_rad or NAME_deg, x_m, site.NAME.yaw_deg"
    )
    add("files", type=Path, metavar="FILE", nargs="+", help=about)
    add("--out", type=Path, metavar="DATASET", required=True, help="the new data set's folder")
    add(
        "--gait",
        action="append",
        metavar="GAIT",
        help=f"the commanded gait, where files hold no commands: {GAIT}; one for all of these files, or one "
        "for each",
    )
    add(
        "--problem",
        metavar="PROBLEM",
        help="the problem that the gait belongs to, for the names of its gaits (default: the bundled ones)",
    )
    add(
        "--command",
        dest="commands",
        action="append",
        default=[],
        type=pair("NAME=COLUMN"),
        metavar="CHANNEL=COLUMN",
        help="column of a channel's commands, where its name does not say it; may be repeated, and no other "
        "columns are taken then",
    )
    add(
        "--signal",
        dest="signals",
        action="append",
        default=[],
        type=pair("NAME=COLUMN"),
        metavar="SIGNAL=COLUMN",
        help="the same for what was measured, such as joint.NAME=COLUMN",
    )
    add(
        "--angle-unit",
        metavar="U",
        help="rad, deg, normalised (-100 to 100), counts or us (pulse widths), where columns do not say it",
    )
    add(
        "--full-scale-deg",
        dest="full_scale_deg",
        action="append",
        default=[],
        type=_scale,
        metavar="[NAME=]DEG",
        help="angle at 100 of normalised angles, of all or of one joint; may be repeated",
    )
    add(
        "--counts-per-turn",
        type=float,
        default=4096.0,
        metavar="N",
        help="counts of an encoder in a turn; angle 0 is in the middle (default: %(default)g)",
    )
    add("--fps", type=float, metavar="N", help="frames per second, where a file counts frames")
    add("--scale-m-per-px", type=float, metavar="M", help="metres per pixel, where a file is in pixels")
    add("--time-unit", metavar="U", help="s, ms, us or ns, where the file does not say")
    add("--length-unit", metavar="U", help="m, cm or mm, where the file does not say")
    add("--view", default="side", help="side: x and z; top: x and y (default: %(default)s)")
    add("--marker", metavar="NAME", help="which of several tracked points")
    add("--sync-at", type=float, metavar="S", help="time stamp at which the gait began, if it was filmed")
    add_json(parser)


def _scale(text: str) -> tuple[str, float]:
    name, _, degrees = text.rpartition("=")
    try:
        return name, number(degrees)
    except ValueError:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: DEG, or NAME=DEG") from None


def run(options: Options) -> None:
    """Import, and print what was read and what is wrong with it."""
    from gaitopt.diagnose.record.export import ImportOptions
    from gaitopt.jobs.imports import import_recordings

    unsaid = ImportOptions(
        fps=options.fps,
        scale_m_per_px=options.scale_m_per_px,
        time_unit=options.time_unit,
        length_unit=options.length_unit,
        view=options.view,
        marker=options.marker,
        sync_at_s=options.sync_at,
        commands=dict(options.commands),
        signals=dict(options.signals),
        angle_unit=options.angle_unit,
        counts_per_turn=options.counts_per_turn,
        full_scale_deg=dict(options.full_scale_deg),
    )
    done = import_recordings(options.files, options.gait, options.out, unsaid, options.problem)
    if options.json:
        print_json(done.to_dict())
        return
    for motion in done.recordings:
        trial = "" if motion.name == motion.source.stem else f" {motion.name}:"
        samples = f"{len(motion.time)} samples of {', '.join(motion.signals)}"
        commands = f"; commands of {', '.join(motion.channels)}" if motion.sent else ""
        say(f"{motion.source}:{trial} {motion.program}, {samples}{commands}")
    for defect in done.defects:
        say(f"- {defect.trial}: {defect.name}: {defect.message}")
    say(f"data set: {done.folder}")


COMMAND = Command(
    name="import",
    summary="convert tracked motion and logs of servos to a data set",
    example="gaitopt import walk.txt --gait square-1s --out trials",
    add_options=add_options,
    run=run,
)
