"""`gaitopt new`: the problem file of a new robot."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_json


def add_options(parser: Parser) -> None:
    """Add the options."""
    add = parser.add_argument
    add("name", metavar="NAME", help="name of the problem and of its folder")
    add("--mjcf", type=Path, metavar="F.xml", required=True, help="the robot")
    add(
        "--family",
        choices=("crawler", "quadruped", "hexapod", "snake", "swimmer", "other"),
        help="what first gaits and limits are drafted for (default: guessed)",
    )
    add("--from-motors", action="store_true", help="make position servos of motors, from gear and range")
    add("--out", type=Path, metavar="DIR", help="the folder (default: NAME)")
    add_json(parser)


def run(options: Options) -> None:
    """Draft, and print what was guessed and what to do next."""
    from gaitopt.jobs.draft import draft_problem

    made = draft_problem(
        options.name, options.mjcf, options.out, from_motors=options.from_motors, family=options.family
    )
    draft, folder = made.draft, made.folder
    if options.json:
        print_json(made.to_dict())
        return
    roles = draft.roles
    channels = ", ".join(channel.name for channel in draft.channels)
    say(f"channels: {channels}; marker: {roles.marker}; pads: {', '.join(roles.pads) or 'none'}")
    why = f", as {draft.family_why}" if draft.family_why else ""
    say(f"family: {draft.family}{why}; first gaits: {', '.join(gait.name for gait in draft.gaits)}")
    say(f"start targets: from {draft.stance}")
    for remark in draft.remarks:
        say(f"guessed: {remark}")
    for warning in draft.warnings:
        say(f"look: {warning}")
    for change in draft.changes:
        say(f"in the copy of the MJCF: {change}")
    say(f"wrote {folder / 'problem.toml'}: correct what is guessed, then")
    say(f"  gaitopt check {folder}")
    say(f"  gaitopt simulate {folder} {draft.gaits[0].name} --video {options.name}.mp4")
    say(f"  gaitopt optimise {folder}")


COMMAND = Command(
    name="new",
    summary="draft the problem file of a new robot",
    example="gaitopt new walker --mjcf walker.xml",
    add_options=add_options,
    run=run,
)
