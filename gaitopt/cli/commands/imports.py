"""`gaitopt import`: recordings of tracking programs to a data set."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json


def add_options(parser: Parser) -> None:
    """Add the options."""
    add = parser.add_argument
    add("files", type=Path, metavar="FILE", nargs="+", help="exports of Tracker, DeepLabCut, SLEAP, Kinovea")
    add("--out", type=Path, metavar="DATASET", required=True, help="the new data set's folder")
    add(
        "--gait",
        action="append",
        required=True,
        metavar="GAIT",
        help="the commanded gait; one for all files, or one for each",
    )
    add("--fps", type=float, metavar="N", help="frames per second, where a file counts frames")
    add("--scale-m-per-px", type=float, metavar="M", help="metres per pixel, where a file is in pixels")
    add("--time-unit", metavar="U", help="s or ms, where the file does not say")
    add("--length-unit", metavar="U", help="m, cm or mm, where the file does not say")
    add("--view", default="side", help="side: x and z; top: x and y (default: %(default)s)")
    add("--marker", metavar="NAME", help="which of several tracked points")
    add("--sync-at", type=float, metavar="S", help="time stamp at which the gait began, if it was filmed")
    add_json(parser)


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
    )
    done = import_recordings(options.files, options.gait, options.out, unsaid)
    if options.json:
        print_json(done.to_dict())
        return
    for path, motion in zip(done.files, done.recordings, strict=True):
        say(f"{path}: {motion.program}, {len(motion.time)} samples of {', '.join(motion.signals)}")
    for defect in done.defects:
        say(f"- {defect.trial}: {defect.name}: {defect.message}")
    say(f"data set: {done.folder}")


COMMAND = Command(
    name="import",
    summary="convert tracked motion to a data set",
    example="gaitopt import walk.txt --gait square-1s --out trials",
    add_options=add_options,
    run=run,
)
