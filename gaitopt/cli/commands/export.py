"""`gaitopt export`: a gait as a table and a player for a servo board."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_executor, add_gait, add_json, add_problem, problem_of

if TYPE_CHECKING:
    from gaitopt.export.handover import Exported


def add_options(parser: Parser) -> None:
    """Add the options."""
    from gaitopt.export.formats import FORMATS

    add_problem(parser)
    add_gait(parser)
    add = parser.add_argument
    add("--format", required=True, choices=FORMATS, help="what to write")
    add("--out", type=Path, metavar="DIR", required=True, help="a new or an empty folder")
    add(
        "--clip",
        action="store_true",
        help="first change the gait to the nearest one inside the servos' range",
    )
    about = "largest speed the player commands: off, servo (its own limit) or degrees/s (default: off)"
    add("--slew", metavar="SPEED", default="off", help=about)
    add("--board", metavar="NAME", values="BOARD", help="esp32 (the default), esp32-s3 or esp32-c3")
    add("--led-pin", type=int, metavar="N", help="GPIO that goes high at gait time 0")
    add("--samples", type=int, default=64, metavar="N", help="phase samples (default: 64)")
    add_json(parser)
    add_executor(parser)


def run(options: Options) -> None:
    """Export, and print the gait's speed as the servos play it."""
    from gaitopt.export.handover import Choices
    from gaitopt.jobs.export import export

    exported = export(
        problem_of(options),
        options.gait,
        Choices(options.format, options.clip, options.slew, options.led_pin, options.samples, options.board),
        options.out,
        executor=options.executor,
        workers=options.workers,
    )
    print_json(exported.to_dict()) if options.json else _print_exported(exported)


def _print_exported(exported: Exported) -> None:
    for name, values in exported.from_datasheet.items():
        if values:
            say(f"{name}: from the datasheet, not measured: {', '.join(values)}")
    for lag in exported.lags:
        say(f"{lag.channel}: the servo falls up to {lag.angle_deg:.3g}° and {lag.time_s:.2g} s behind")
    replay = exported.replay
    ideal, replayed = 1e3 * replay.ideal_m_s, 1e3 * replay.replayed_m_s
    loss = ""
    if replay.loss is not None and replay.loss_ci90 is not None:
        low, high = replay.loss_ci90
        loss = f": a loss of {replay.loss:.1%} (90 % interval {low:.1%} to {high:.1%})"
    say(f"simulated: {ideal:.2f} mm/s as a gait, {replayed:.2f} mm/s as the servos will get it{loss}")
    say(
        f"This is the nominal robot from {replay.settings.starts} start poses, at the working fidelity; "
        "`gaitopt compare` has the speed over scenarios, at the reference fidelity."
    )
    for warning in exported.warnings:
        say(f"warning: {warning}")
    for file in exported.files:
        say(file)


COMMAND = Command(
    name="export",
    summary="write a gait as a table and a player for RC or bus servos, after a test in simulation",
    example="gaitopt export arcfold square-1s --format micropython --out walk",
    add_options=add_options,
    run=run,
)
