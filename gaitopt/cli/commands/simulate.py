"""`gaitopt simulate`: one gait on the nominal robot."""

from __future__ import annotations

from pathlib import Path

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_gait, add_json, add_posterior, add_problem, problem_of
from gaitopt.core.errors import GaitoptError


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add_gait(parser, logs=True)
    add = parser.add_argument
    add("--csv", type=Path, metavar="F", help="write the time series here")
    add("--video", type=Path, metavar="F", help="write a film: a file that ends in .mp4, .gif or .webp")
    add("--beside", metavar="GAIT", help="with --video: show this gait too, side by side")
    add("--measured", type=Path, metavar="DATASET", help="with --video: show the measured marker, too")
    add("--seconds", type=float, metavar="S", help="length of the film (default: whole cycles, 5 s or more)")
    add("--view", action="store_true", help="play it in MuJoCo's viewer, where there is a screen")
    add_posterior(parser, "its robots are simulated, too")
    add_json(parser)


def run(options: Options) -> None:
    """Simulate, and print the metrics."""
    for name in ("beside", "measured", "seconds"):
        if getattr(options, name) is not None and options.video is None:
            raise GaitoptError(f"--{name}: found no --video to go with it")
    from gaitopt.cli.display import print_over_robots, print_rows
    from gaitopt.jobs.film import FilmOptions
    from gaitopt.jobs.simulate import simulate, view_rollout
    from gaitopt.report.words import ON_NOMINAL

    film = FilmOptions(options.beside, options.measured, options.seconds)
    rollout = simulate(
        problem_of(options),
        options.gait,
        csv=options.csv,
        video=options.video,
        film=film,
        view=options.view,
        posterior=options.posterior,
    )
    rows, over = [rollout.to_dict()], rollout.over_robots
    if options.json:
        print_json({"rows": rows} | ({} if over is None else {"posterior": over.to_dict()}))
    elif over is None:
        print_rows(rows)
    else:
        print_over_robots(rollout, over)
    if not options.json and "speed_m_s" in rollout.metrics:
        say(f"One rollout {ON_NOMINAL}")
    if options.view:
        view_rollout(rollout)


COMMAND = Command(
    name="simulate",
    summary="simulate one gait, or a log of commands",
    example="gaitopt simulate arcfold square-1s --video walk.mp4",
    add_options=add_options,
    run=run,
)
