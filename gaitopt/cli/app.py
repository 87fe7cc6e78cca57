"""The command line: arguments in, calls, text and exit code out."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from gaitopt.core.errors import GaitoptError
from gaitopt.core.interrupts import interrupts_between_imports
from gaitopt.robot.warnings import silence_warnings

if TYPE_CHECKING:
    from gaitopt.export.handover import Exported
    from gaitopt.gait.gait import Gait
    from gaitopt.problem.problem import Problem
    from gaitopt.runs.summary import Summary

COMMAND = "command"
"""Where the parser keeps the command's name."""

DONE, STATED_PROBLEM, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    os.environ.setdefault("MPLBACKEND", "Agg")  # a command draws into files, never into windows
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a letter that a terminal lacks is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    try:
        with interrupts_between_imports():
            words = sys.argv[1:] if arguments is None else list(arguments)
            options = build_parser().parse_args(_canonical(words))
            silence_warnings()
            options.run(options)
    except SystemExit as stop:
        return int(stop.code or 0)
    except GaitoptError as problem:
        print(f"gaitopt: {problem}", file=sys.stderr)
        return STATED_PROBLEM
    except KeyboardInterrupt:
        print("gaitopt: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader went away; nothing is left to tell it
        return STATED_PROBLEM
    except OSError as problem:
        said = GaitoptError(f"{_where(problem)}{problem.strerror or problem}")
        print(f"gaitopt: {said}", file=sys.stderr)
        return STATED_PROBLEM
    except MemoryError:
        print("gaitopt: out of memory", file=sys.stderr)
        return STATED_PROBLEM
    return DONE


def _where(problem: OSError) -> str:
    return f"{problem.filename}: " if problem.filename else ""


def _canonical(arguments: list[str]) -> list[str]:
    """Accept the other spelling of the main command."""
    return ["optimise", *arguments[1:]] if arguments[:1] == ["optimize"] else arguments


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        print(f"gaitopt: {GaitoptError(message)}; see {self.prog} --help", file=sys.stderr)
        raise SystemExit(WRONG_USAGE)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of every command."""
    parser = _Parser(
        prog="gaitopt",
        description="Find better gaits for small crawling robots, compare them with hand-tuned ones.",
        epilog="example: gaitopt optimise arcfold",
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(title="commands", dest=COMMAND, metavar="COMMAND", required=True)

    def command(
        name: str, run: Callable[[Any], None], about: str, example: str, problem_needed: bool = True
    ) -> argparse.ArgumentParser:
        sub = commands.add_parser(
            name, help=about, description=about[0].upper() + about[1:] + ".", epilog=f"example: {example}"
        )
        sub.set_defaults(run=run)
        sub.add_argument(
            "problem",
            metavar="PROBLEM",
            help="folder, problem TOML, or bundled name",
            nargs=None if problem_needed else "?",
        )
        sub.add_argument(
            "--set", dest="parameters", metavar="NAME=VALUE", action="append", default=[], type=_assignment,
            help="change a named model parameter; may be repeated",
        )  # fmt: skip
        return sub

    optimise = command(
        "optimise",
        _optimise,
        "run baselines, search for the best gait, verify it and report",
        "gaitopt optimise arcfold --budget 600 --seed 1",
    )
    _add_search_options(optimise)
    _add_output_options(optimise)

    plan = command(
        "plan",
        _plan,
        "plan gaits with the reduced planar model, without MuJoCo's steps",
        "gaitopt plan arcfold",
    )
    plan.add_argument("--seed", type=int, default=1, help="seed of the random starts (default: %(default)s)")
    plan.add_argument("--json", action="store_true", help="print JSON and nothing else")

    simulate = command(
        "simulate", _simulate, "simulate one gait", "gaitopt simulate arcfold square-1s --video walk.mp4"
    )
    _add_simulate_options(simulate)

    sweep = command(
        "sweep",
        _sweep,
        "simulate a gait over a range of one parameter",
        "gaitopt sweep arcfold --over period_s=4,2,1,0.5",
    )
    sweep.add_argument("gait", metavar="GAIT", nargs="?", help="the first baseline by default")
    sweep.add_argument(
        "--over", metavar="NAME=V1,V2,…", required=True, help="period_s, CHANNEL.KEY or a parameter"
    )
    _add_output_options(sweep)
    _add_worker_option(sweep)

    compare = command(
        "compare",
        _compare,
        "compare gaits over the same scenarios, with intervals",
        "gaitopt compare arcfold square-2s square-1s",
    )
    compare.add_argument(
        "gaits", metavar="GAIT", nargs="+", help="baselines, gait files, exported tables or run folders"
    )
    compare.add_argument("--seed", type=int, default=1, help="seed of the scenarios (default: %(default)s)")
    _add_report_options(compare)
    _add_worker_option(compare)

    check = command(
        "check",
        _check,
        "audit a model: what would make its gaits mean nothing on a real robot",
        "gaitopt check arcfold",
    )
    _add_report_options(check)
    _add_worker_option(check)

    effects = command(
        "effects",
        _effects,
        "list the effects that a model may lack",
        "gaitopt effects arcfold",
        problem_needed=False,
    )
    effects.add_argument("--json", action="store_true", help="print JSON and nothing else")

    model = command(
        "model", _model, "write the nominal model as one MJCF", "gaitopt model arcfold --out arcfold.xml"
    )
    model.add_argument("--out", type=Path, metavar="F.xml", required=True, help="where to write it")

    sent = command(
        "command",
        _command,
        "write what is sent to each actuator",
        "gaitopt command arcfold square-1s --dt 0.01 --duration 2 --out command.csv",
    )
    sent.add_argument("gait", metavar="GAIT", help="baseline, gait file, exported table or run folder")
    sent.add_argument("--dt", type=float, metavar="S", required=True, help="time between rows, s")
    sent.add_argument("--duration", type=float, metavar="S", required=True, help="rows end before this, s")
    sent.add_argument("--out", type=Path, metavar="F.csv", required=True, help="where to write it")

    diagnose = command(
        "diagnose",
        _diagnose,
        "compare measured trials with the simulation: where the gap lies and what causes it",
        "gaitopt diagnose arcfold trials",
    )
    _add_diagnose_options(diagnose)
    _add_blind(commands)

    importing = commands.add_parser(
        "import",
        help="turn tracked motion into a data set",
        description="Turn tracked motion into a data set.",
        epilog="example: gaitopt import walk.txt --gait square-1s --out trials",
    )
    importing.set_defaults(run=_import)
    _add_import_options(importing)

    export = command(
        "export",
        _export,
        "write a gait as a table and a player for an ESP32 with RC servos, once it walks in simulation",
        "gaitopt export arcfold square-1s --format micropython --out walk",
    )
    _add_export_options(export)

    fresh = commands.add_parser(
        "new",
        help="draft the problem file of a new robot",
        description="Draft the problem file of a new robot.",
        epilog="example: gaitopt new walker --mjcf walker.xml",
    )
    fresh.set_defaults(run=_new)
    fresh.add_argument("name", metavar="NAME", help="name of the problem and of its folder")
    fresh.add_argument("--mjcf", type=Path, metavar="F.xml", required=True, help="the robot")
    fresh.add_argument("--out", type=Path, metavar="DIR", help="the folder (default: NAME)")

    demo = commands.add_parser(
        "demo",
        help="a first look in under a minute",
        description="Search a better gait for ArcFold, briefly, and write the report.",
        epilog="example: gaitopt demo",
    )
    demo.set_defaults(run=_demo, executor="threads", workers=None, json=False, full=True, sensitivities=False)
    demo.add_argument(
        "--out", type=Path, metavar="DIR", help="run folder (default: a new one in results/runs)"
    )
    demo.add_argument("--quiet", action="store_true", help="no progress display")

    completion = commands.add_parser(
        "completion",
        help="print a script that completes commands and options in a shell",
        description="Print a script that completes commands and options in a shell.",
        epilog="example: gaitopt completion bash > ~/.local/share/bash-completion/completions/gaitopt",
    )
    completion.set_defaults(run=_completion)
    completion.add_argument("shell", metavar="SHELL", help="bash, zsh or fish")
    return parser


def _add_simulate_options(sub: argparse.ArgumentParser) -> None:
    add = sub.add_argument
    add("gait", metavar="GAIT", help="baseline, gait file, exported table or run folder")
    add("--csv", type=Path, metavar="F", help="write the time series here")
    add("--video", type=Path, metavar="F", help="film it: a file that ends in .mp4, .gif or .webp")
    add("--beside", metavar="GAIT", help="with --video: film this gait too, side by side")
    add("--measured", type=Path, metavar="DATASET", help="with --video: show the marker measured, too")
    add("--seconds", type=float, metavar="S", help="length of the film (default: whole cycles, 5 s or more)")
    add("--view", action="store_true", help="play it in MuJoCo's viewer, where there is a screen")
    add("--json", action="store_true", help="print JSON and nothing else")


def _add_blind(commands: Any) -> None:
    """Add ``blind make`` and ``blind score``."""
    about = "make sealed cases, and score diagnoses on them"
    blind = commands.add_parser(
        "blind",
        help=about,
        description=about[0].upper() + about[1:] + ".",
        epilog="example: gaitopt blind make arcfold --cases 10 --seed 1 --out cases",
    )
    actions = blind.add_subparsers(title="actions", metavar="ACTION", required=True)
    make = actions.add_parser(
        "make",
        help="draw sealed cases",
        description="Draw sealed cases: data sets whose cause is known to blind score alone.",
        epilog="example: gaitopt blind make arcfold --cases 10 --seed 1 --out cases",
    )
    make.set_defaults(run=_blind_make, parameters=[])
    add = make.add_argument
    add("problem", metavar="PROBLEM", help="folder, problem TOML, or bundled name")
    add("--cases", type=int, metavar="N", required=True, help="how many")
    add("--seed", type=int, help="seed of all randomness (default: 1)")
    add("--out", type=Path, metavar="DIR", required=True, help="their folder; cases it holds are kept")
    add("--seconds", type=float, default=12.0, metavar="S", help="length of a trial (default: 12)")
    add("--gaits", metavar="A,B,…", help="baselines filmed (default: all)")
    add(
        "--signals",
        metavar="A,B,…",
        help="what is measured (default: the marker and the first servo's joint)",
    )
    add("--kind", choices=("single", "none", "outside", "pair"), help="make this kind alone")
    add("--only", metavar="NAME", help="with --kind: plant this effect or disturbance")
    _add_worker_option(make)
    rating = actions.add_parser(
        "score",
        help="compare diagnoses with the sealed truth",
        description="Compare diagnoses with the sealed truth; cases without one are diagnosed first.",
        epilog="example: gaitopt blind score cases",
    )
    rating.set_defaults(run=_blind_score)
    rating.add_argument("folder", type=Path, metavar="DIR", help="the folder that blind make made")
    rating.add_argument(
        "--diagnoses", type=Path, metavar="D", help="run folders, one a case (default: DIR/diagnoses)"
    )
    rating.add_argument("--json", action="store_true", help="print JSON and nothing else")
    _add_worker_option(rating)


def _add_diagnose_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("dataset", type=Path, metavar="DATASET", help="folder with dataset.toml and its trials")
    sub.add_argument("--seed", type=int, help="seed of all randomness (default: 1)")
    sub.add_argument("--effects", metavar="A,B,…", help="try these effects alone (default: all that apply)")
    sub.add_argument("--full", action="store_true", help="add a film with the measured marker to the report")
    sub.add_argument("--resume", type=Path, metavar="DIR", help="go on with an interrupted diagnosis")
    sub.add_argument("--quiet", action="store_true", help="no progress display")
    _add_output_options(sub)
    _add_worker_option(sub)


def _add_import_options(sub: argparse.ArgumentParser) -> None:
    add = sub.add_argument
    add("files", type=Path, metavar="FILE", nargs="+", help="exports of Tracker, DeepLabCut, SLEAP, Kinovea")
    add("--out", type=Path, metavar="DATASET", required=True, help="the new data set's folder")
    add("--gait", action="append", required=True, metavar="GAIT", help="what was commanded; one, or one each")
    add("--fps", type=float, metavar="N", help="frames a second, where a file counts frames")
    add("--scale-m-per-px", type=float, metavar="M", help="metres a pixel, where a file is in pixels")
    add("--time-unit", metavar="U", help="s or ms, where the file does not say")
    add("--length-unit", metavar="U", help="m, cm or mm, where the file does not say")
    add("--view", default="side", help="side: x and z; top: x and y (default: %(default)s)")
    add("--marker", metavar="NAME", help="which of several tracked points")
    add("--sync-at", type=float, metavar="S", help="time stamp at which the gait began, if it was filmed")
    add("--json", action="store_true", help="print JSON and nothing else")


def _add_export_options(sub: argparse.ArgumentParser) -> None:
    from gaitopt.export.formats import FORMATS

    sub.add_argument("gait", metavar="GAIT", help="baseline, gait file, exported table or run folder")
    sub.add_argument(
        "--format", required=True, choices=FORMATS,
        help="what to write",
    )  # fmt: skip
    sub.add_argument("--out", type=Path, metavar="DIR", required=True, help="a new or an empty folder")
    sub.add_argument("--clip", action="store_true", help="bring the gait inside the servos' range first")
    sub.add_argument(
        "--slew", metavar="SPEED", default="off",
        help="largest speed the player commands: off, servo (its own limit) or degrees/s (default: off)",
    )  # fmt: skip
    sub.add_argument("--led-pin", type=int, metavar="N", help="GPIO that goes high at gait time 0")
    sub.add_argument("--samples", type=int, default=64, metavar="N", help="phase samples (default: 64)")
    sub.add_argument("--json", action="store_true", help="print JSON and nothing else")
    _add_worker_option(sub)


def _add_search_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--budget", type=int, help="gaits to evaluate (default: 600)")
    sub.add_argument("--seed", type=int, help="seed of all randomness (default: 1)")
    sub.add_argument("--method", help="default, cma-es or nelder-mead")
    sub.add_argument(
        "--warm-start", action=argparse.BooleanOptionalAction, default=None, help="start from planned gaits"
    )
    sub.add_argument(
        "--pareto", action="store_const", const=True,
        help="spend half of the budget on a front of speed against cost of transport",
    )  # fmt: skip
    sub.add_argument(
        "--executor",
        default="threads",
        metavar="NAME",
        help="threads, processes, serial or dask://HOST:PORT (default: %(default)s)",
    )  # fmt: skip
    sub.add_argument("--resume", type=Path, metavar="DIR", help="go on with an interrupted run")
    sub.add_argument("--quiet", action="store_true", help="no progress display")
    sub.add_argument("--full", action="store_true", help="add a film and sensitivities to the report")
    sub.set_defaults(sensitivities=True)
    _add_worker_option(sub)


def _add_worker_option(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--workers", type=int, metavar="N", help="rollouts at once (default: all cores)")


def _add_output_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--out", type=Path, metavar="DIR", help="run folder (default: a new one in results/runs)"
    )
    sub.add_argument("--json", action="store_true", help="print JSON and nothing else")


def _add_report_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--out", type=Path, metavar="DIR", help="write a report with figures into this folder")
    sub.add_argument("--json", action="store_true", help="print JSON and nothing else")


def _assignment(text: str) -> tuple[str, float]:
    name, separator, value = text.partition("=")
    try:
        if not separator:
            raise ValueError
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: NAME=VALUE with a number") from None


def _version() -> str:
    from importlib.metadata import version

    return f"gaitopt {version('gaitopt')}"


# --- commands ---------------------------------------------------------------------------------


def _load(options: argparse.Namespace) -> Problem:
    from gaitopt.problem.model import carrying
    from gaitopt.problem.problem import load_problem

    # Its files may change while the command runs: they are read once.
    return carrying(load_problem(options.problem, dict(options.parameters)))


def _optimise(options: argparse.Namespace) -> None:
    from gaitopt.optimise.executors import open_executor

    open_executor(options.executor, options.workers).shutdown()  # says what is wrong before a folder is made
    folder, problem, request = _open_run(options)
    _run_search(folder, problem, request, options)


def _demo(options: argparse.Namespace) -> None:
    from gaitopt.cli.demo import REQUEST, demo_problem
    from gaitopt.runs.run_folder import RunFolder

    problem = demo_problem()
    folder = RunFolder.create(options.out, problem, REQUEST)
    _run_search(folder, problem, REQUEST, options)
    print("This was a brief search over few scenarios. For the real thing, type: gaitopt optimise arcfold")


def _run_search(folder: Any, problem: Problem, request: Any, options: argparse.Namespace) -> None:
    from gaitopt.core.json import to_json
    from gaitopt.report.words import answer_of

    with folder, _saying_how_to_resume(folder, problem):
        summary = folder.summary or _searched(folder, problem, request, options)
        if options.json:
            print(to_json(summary.to_dict()), end="")
        else:
            _print_summary(summary)
            print(answer_of(summary))
            print(f"report: {folder.path / 'report.html'}")


def _searched(folder: Any, problem: Problem, request: Any, options: argparse.Namespace) -> Summary:
    """Do or go on with the work of a run, and return its summary."""
    from gaitopt.cli.display import progress_display
    from gaitopt.optimise.executors import open_executor, working
    from gaitopt.optimise.journal import Journal
    from gaitopt.optimise.run import optimise
    from gaitopt.optimise.sensitivity import sensitivities
    from gaitopt.problem.model import carrying
    from gaitopt.report.search import write_report

    with (
        working(open_executor(options.executor, options.workers)) as executor,
        progress_display(request.budget, quiet=options.quiet or options.json) as display,
    ):
        problem = carrying(problem)
        optimised = optimise(problem, request, Journal(folder.journal, problem), executor, display)
        asked = options.full and options.sensitivities
        sensitive = sensitivities(problem, optimised.best.gait, request.seed, executor) if asked else []
    write_report(folder, problem, optimised, options.full, sensitive)
    summary: Summary = folder.write_results(problem, optimised)  # last: it says that the run is done
    return summary


def _open_run(options: argparse.Namespace) -> tuple[Any, Problem, Any]:
    from gaitopt.core.errors import nearest
    from gaitopt.optimise.run import DEFAULT_BUDGET, Request
    from gaitopt.optimise.study import METHODS
    from gaitopt.runs.run_folder import RunFolder
    from gaitopt.simulation.objective import check_searchable

    if options.resume is not None:
        given = [
            name
            for name in ("budget", "seed", "method", "warm_start", "pareto", "out")
            if getattr(options, name) is not None
        ]
        if given or options.parameters:
            name = (given or ["set"])[0].replace("_", "-")
            raise GaitoptError(f"--{name}: not with --resume, which takes it from {options.resume}")
        reopened = RunFolder.reopen(options.resume)
        return reopened.folder, reopened.problem, reopened.request
    problem = _load(options)
    budget = DEFAULT_BUDGET if options.budget is None else options.budget
    if budget < 1:
        raise GaitoptError(f"--budget: found {budget}; allowed: 1 or more")
    seed = _seed(options.seed)
    method = options.method or "default"
    if method not in METHODS:
        raise GaitoptError(
            f"--method: found {method!r}; allowed: {', '.join(METHODS)}{nearest(method, METHODS)}"
        )
    check_searchable(problem)
    request = Request(seed, budget, method, options.warm_start is not False, bool(options.pareto))
    return RunFolder.create(options.out, problem, request), problem, request


@contextmanager
def _saying_how_to_resume(folder: Any, problem: Problem) -> Iterator[None]:
    """Where Ctrl-C ends a run, say what it has found and how to go on with it."""
    import shlex

    from gaitopt.optimise.journal import Journal, at_rung, ranked

    try:
        yield
    except KeyboardInterrupt:
        if folder.started:
            entries = Journal(folder.journal, problem).entries
            best = ranked(at_rung(entries))[0].evaluation
            walks = best.status == "ok"
            found = f"{1e3 * best.metrics['speed_m_s']:.1f} mm/s" if walks else "none that walks"
            path = shlex.quote(str(folder.path))
            print(
                f"gaitopt: stopped after {len(entries)} gaits, best so far {found}; "
                f"go on with: gaitopt optimise {path} --resume {path}",
                file=sys.stderr,
            )
        raise


def _plan(options: argparse.Namespace) -> None:
    from gaitopt.core.json import to_json
    from gaitopt.plan.plan import MISSES, Planner, PlanSettings, plan_rows

    problem = _load(options)
    plan = Planner(problem, PlanSettings(seed=_seed(options.seed))).plan()
    if options.json:
        print(to_json(plan_rows(plan)), end="")
        return
    for line in plan.dropped:
        print(f"dropped: {line}")
    rows = [
        {"name": e.gait.name, "period_s": e.gait.period_s, "predicted_speed_m_s": e.predicted_speed_m_s}
        for e in plan.elites
    ]
    rows += [
        {"name": name, "period_s": problem.baselines[name].period_s, "predicted_speed_m_s": speed}
        for name, speed in plan.baselines.items()
    ]
    _print_rows(rows, as_json=False)
    for name, creep in plan.creep.items():
        print(f"{name}: smoothed friction changes the predicted speed by {1e3 * creep:+.2f} mm/s")
    print(MISSES)


def _seed(value: int | None) -> int:
    if value is None:
        return 1
    if value < 0:
        raise GaitoptError(f"--seed: found {value}; allowed: 0 or more")
    return value


def _simulate(options: argparse.Namespace) -> None:
    from gaitopt.core.files import write_text
    from gaitopt.problem.robot import Robot
    from gaitopt.simulation.metrics import measure
    from gaitopt.simulation.rollout import Simulator

    _check_film_options(options)
    problem = _load(options)
    gait = problem.find_gait(options.gait)
    simulator = Simulator.build(problem)
    filmed = _takes(options, simulator, gait)
    trajectory = filmed[0].trajectory if filmed else simulator.run(gait)
    if options.csv is not None:
        write_text(options.csv, simulator.observe(trajectory).to_csv())
    metrics = measure(problem, gait, trajectory, Robot.of(simulator.models[0]))
    row = {"name": gait.name, "period_s": gait.period_s, "status": trajectory.status} | metrics
    if options.video is not None:
        from gaitopt.report.film.film import write_film

        write_film(options.video, filmed, end=options.seconds)
    _print_rows([row], options.json)
    if options.view:
        from gaitopt.report.film.viewer import view

        view(filmed[0])


def _check_film_options(options: argparse.Namespace) -> None:
    for name in ("beside", "measured", "seconds"):
        if getattr(options, name) is not None and options.video is None:
            raise GaitoptError(f"--{name}: found no --video to go with it")
    if options.video is not None:
        from gaitopt.report.film.film import check_film

        _positive("seconds", options.seconds)
        check_film(options.video)
    if options.view:
        from gaitopt.report.film.viewer import check_screen

        check_screen()


def _takes(options: argparse.Namespace, simulator: Any, gait: Gait) -> list[Any]:
    """Return what a film shows, from left to right; nothing where none is asked for."""
    if options.video is None and not options.view:
        return []
    from gaitopt.report.film.film import film_length
    from gaitopt.report.film.take import take, take_beside

    gaits = [gait]
    if options.beside is not None:
        gaits.append(simulator.problem.find_gait(options.beside))
    length = options.seconds or film_length(gaits)
    if options.measured is None:
        return [take(simulator, shown, length) for shown in gaits]
    from gaitopt.diagnose.record.dataset import load_dataset
    from gaitopt.report.film.ghost import trial_of

    signals = [name for name in simulator.signals if name]
    dataset = load_dataset(options.measured, simulator.problem, signals)
    return [take_beside(simulator, trial_of(dataset, shown), length) for shown in gaits]


def _sweep(options: argparse.Namespace) -> None:
    from gaitopt.core.files import write_text
    from gaitopt.core.json import to_json
    from gaitopt.optimise.executors import open_executor
    from gaitopt.optimise.sweep import Sweep, sweep
    from gaitopt.report.sweep import write_sweep

    problem = _load(options)
    gait = _first_gait(problem, options.gait)
    points = Sweep.parse(options.over).points(problem, gait)
    with open_executor("threads", options.workers) as executor:
        rows = [row.to_dict() for row in sweep(points, executor)]
    folder = write_sweep(options.out, problem, points)
    write_text(folder / "sweep.json", to_json({"rows": rows}))
    _print_rows(rows, options.json)
    if not options.json:
        print(f"plots: {folder}")


def _first_gait(problem: Problem, name: str | None) -> Gait:
    if name is not None:
        return problem.find_gait(name)
    if not problem.baselines:
        raise GaitoptError(f"{problem.source}: no baselines; name a gait")
    return next(iter(problem.baselines.values()))


def _compare(options: argparse.Namespace) -> None:
    from gaitopt.cli.display import print_comparison
    from gaitopt.core.folders import check_new_or_empty
    from gaitopt.core.json import to_json
    from gaitopt.optimise.compare import compare
    from gaitopt.optimise.executors import open_executor
    from gaitopt.report.comparison import write_comparison
    from gaitopt.report.words import verdicts
    from gaitopt.simulation.objective import check_objective

    check_new_or_empty(options.out)
    problem = _load(options)
    check_objective(problem)
    gaits = [problem.find_gait(name) for name in options.gaits]
    with open_executor("threads", options.workers) as executor:
        rows = compare(problem, gaits, _seed(options.seed), executor)
    if options.out is not None:
        write_comparison(options.out, problem, gaits, rows, _seed(options.seed))
    if options.json:
        print(to_json({"rows": [row.to_dict() for row in rows]}), end="")
    else:
        print_comparison(rows)
        for sentence in verdicts(rows):
            print(sentence)
        _say_where(options.out)


def _check(options: argparse.Namespace) -> None:
    from gaitopt.cli.display import note
    from gaitopt.core.folders import check_new_or_empty
    from gaitopt.core.json import to_json
    from gaitopt.optimise.executors import open_executor
    from gaitopt.simulation.check import check

    check_new_or_empty(options.out)
    problem = _load(options)
    with open_executor("threads", options.workers) as executor:
        findings = check(problem, executor, (lambda _: None) if options.json else note)
    rows = [finding.to_dict() for finding in findings]
    if options.out is not None:
        from gaitopt.report.audit import write_audit

        write_audit(options.out, problem, findings)
    if options.json:
        print(to_json({"findings": rows}), end="")
        return
    if not findings:
        print(f"{problem.name}: nothing found")
    for finding in findings:
        where = f" at {finding.gait}" if finding.gait else ""
        print(f"{finding.name}{where}: {finding.message}")
    _say_where(options.out)


def _say_where(folder: Path | None) -> None:
    if folder is not None:
        print(f"report: {folder / 'report.html'}")


def _effects(options: argparse.Namespace) -> None:
    from gaitopt.cli.display import print_effects
    from gaitopt.core.json import to_json
    from gaitopt.effects.rows import effect_rows
    from gaitopt.problem.model import nominal_parts

    if options.problem is None and options.parameters:
        raise GaitoptError("--set: found no PROBLEM to set a parameter of")
    rows = effect_rows(None if options.problem is None else nominal_parts(_load(options)))
    if options.json:
        print(to_json({"rows": [row.to_dict() for row in rows]}), end="")
    else:
        print_effects(rows)


def _model(options: argparse.Namespace) -> None:
    from gaitopt.core.files import write_text
    from gaitopt.problem.model import nominal_mjcf

    write_text(options.out, nominal_mjcf(_load(options)))
    print(options.out)


def _command(options: argparse.Namespace) -> None:
    import math

    import numpy as np

    from gaitopt.core.files import csv_text, write_text
    from gaitopt.problem.model import build_model
    from gaitopt.simulation.rollout import servo_commands

    for name in ("dt", "duration"):
        value = getattr(options, name)
        if not (math.isfinite(value) and value > 0.0):
            raise GaitoptError(f"--{name}: found {value}; allowed: a positive number of seconds")
    ratio = options.duration / options.dt * (1.0 - 1e-12)
    if not ratio <= 50_000_000:
        raise GaitoptError(f"--dt: found {options.dt:g}; allowed: at most 50 million rows, not {ratio:.3g}")
    rows = math.ceil(ratio)
    problem = _load(options)
    build_model(problem)  # the channels are the model's actuators in order
    time = np.arange(rows) * options.dt
    targets = servo_commands(problem, problem.find_gait(options.gait), time)
    columns = {"t_s": time} | dict(zip(problem.channel_names, targets.T, strict=True))
    write_text(options.out, csv_text(columns))
    print(options.out)


def _diagnose(options: argparse.Namespace) -> None:
    from gaitopt.cli.display import steps_display
    from gaitopt.core.errors import unknown_name
    from gaitopt.core.folders import check_new_or_empty
    from gaitopt.diagnose.diagnosis import diagnose
    from gaitopt.diagnose.fit.cache import SimulationCache
    from gaitopt.diagnose.record.dataset import load_dataset
    from gaitopt.effects import EFFECTS
    from gaitopt.optimise.executors import open_executor, working
    from gaitopt.report.diagnosis_report import diagnosis_folder, write_diagnosis
    from gaitopt.simulation.rollout import Simulator

    if options.resume is not None:
        _check_resumed(options)
        if (options.resume / "diagnosis.json").is_file():
            _print_diagnosis(options.resume, options.json)
            return
    check_new_or_empty(options.out)
    problem = _load(options)
    among = options.effects.split(",") if options.effects else None
    for name in among or ():
        if name not in EFFECTS:
            raise unknown_name("diagnose", "effect in --effects:", name, EFFECTS)
    simulator = Simulator.build(problem)
    dataset = load_dataset(options.dataset, problem, [name for name in simulator.signals if name])
    seed = _seed(options.seed)
    with (
        diagnosis_folder(options.out, options.resume, problem.name) as folder,
        working(open_executor("threads", options.workers)) as executor,
        steps_display(options.quiet or options.json) as note,
    ):
        memory = SimulationCache.of(folder, simulator, dataset, seed)
        if options.resume is not None and not memory.count:
            raise GaitoptError(
                f"--resume: {folder}: nothing was simulated there with this problem, data set and seed"
            )
        with _saying_how_to_go_on(memory, options):
            diagnosis = diagnose(simulator, dataset, executor, seed, note, among=among, memory=memory)
            write_diagnosis(folder, problem, diagnosis, executor, options.full)
        memory.clear()
    _print_diagnosis(folder, options.json)


def _check_resumed(options: argparse.Namespace) -> None:
    if options.out is not None:
        raise GaitoptError(f"--out: not with --resume, which goes on in {options.resume}")
    if not options.resume.is_dir():
        raise GaitoptError(f"--resume: {options.resume}: no such folder")


def _print_diagnosis(folder: Path, as_json: bool) -> None:
    """Print a finished diagnosis: its answer in words, or its file."""
    from gaitopt.core.files import read_json
    from gaitopt.core.json import to_json

    path = folder / "diagnosis.json"
    content = read_json(path)
    said = (content.get("answer"), content.get("explanation")) if isinstance(content, dict) else ()
    if not (said and isinstance(said[0], str) and isinstance(said[1], list)):
        raise GaitoptError(f"{path}: not the answer of a diagnosis: changed since?")
    if as_json:
        print(to_json(content), end="")
        return
    print(content["answer"])
    for sentence in content["explanation"]:
        print(f"- {sentence}")
    print(f"report: {folder / 'report.html'}")


@contextmanager
def _saying_how_to_go_on(memory: Any, options: argparse.Namespace) -> Iterator[None]:
    """Where Ctrl-C ends a diagnosis, say how to go on with it."""
    import shlex

    try:
        yield
    except KeyboardInterrupt:
        if memory.count:
            folder = memory.folder.parent
            words = ["gaitopt", "diagnose", options.problem, options.dataset, "--resume", folder]
            if options.effects:
                words += ["--effects", options.effects]
            if options.seed is not None:
                words += ["--seed", options.seed]
            for name, value in options.parameters:
                words += ["--set", f"{name}={value!r}"]
            print(
                f"gaitopt: stopped after {memory.count} robots; go on with: "
                + " ".join(shlex.quote(str(word)) for word in words),
                file=sys.stderr,
            )
        raise


def _blind_make(options: argparse.Namespace) -> None:
    from gaitopt.blind.cases import CaseRequest, kinds_of, make_cases
    from gaitopt.blind.factory import RecordingPlan
    from gaitopt.core.errors import bad_value
    from gaitopt.optimise.executors import open_executor

    problem = _load(options)
    if options.cases < 1:
        raise bad_value("blind make", "--cases", options.cases, "1 or more")
    if options.only and not options.kind:
        raise bad_value("blind make", "--only", options.only, "with --kind single or outside")
    gaits = options.gaits.split(",") if options.gaits else list(problem.baselines)
    signals = options.signals.split(",") if options.signals else None
    seed = _seed(options.seed)
    kinds = [options.kind] * options.cases if options.kind else kinds_of(options.cases, seed)
    with open_executor("threads", options.workers) as executor:
        plan = RecordingPlan(gaits, options.seconds, signals)
        faint = make_cases(problem, options.out, CaseRequest(kinds, seed, plan, options.only), executor)
    print(f"{len(kinds)} cases: {options.out}; their truth: {options.out / 'sealed'}")
    if faint:
        print(f"drawn but too faint within their bounds, on some target or side: {', '.join(faint)}")


def _blind_score(options: argparse.Namespace) -> None:
    from gaitopt.blind.answers import read_cases
    from gaitopt.blind.scoring import score, sentences
    from gaitopt.cli.display import steps_display
    from gaitopt.core.json import to_json
    from gaitopt.optimise.executors import open_executor
    from gaitopt.report.diagnosis_report import diagnose_folders

    diagnoses = options.diagnoses or options.folder / "diagnoses"
    with open_executor("threads", options.workers) as executor, steps_display(options.json) as note:
        diagnose_folders(options.folder, diagnoses, executor, note)
    record = score(read_cases(options.folder, diagnoses))
    if options.json:
        print(to_json(record.to_dict()), end="")
        return
    for sentence in sentences(record):
        print(sentence)


def _import(options: argparse.Namespace) -> None:
    from gaitopt.core.json import to_json
    from gaitopt.diagnose.record.export import ImportOptions
    from gaitopt.diagnose.record.importing import import_files

    given = ImportOptions(
        _positive("fps", options.fps),
        _positive("scale-m-per-px", options.scale_m_per_px),
        options.time_unit,
        options.length_unit,
        options.view,
        options.marker,
        options.sync_at,
    )
    imported = import_files(options.files, options.gait, options.out, given)
    defects = [defect for motion in imported for defect in motion.defects]
    if options.json:
        trials = [
            {"name": path.stem, "program": motion.program, "signals": list(motion.signals)}
            for path, motion in zip(options.files, imported, strict=True)
        ]
        rows = [defect.to_dict() for defect in defects]
        print(to_json({"dataset": str(options.out), "trials": trials, "defects": rows}), end="")
        return
    for path, motion in zip(options.files, imported, strict=True):
        print(f"{path}: {motion.program}, {len(motion.time)} samples of {', '.join(motion.signals)}")
    for defect in defects:
        print(f"- {defect.trial}: {defect.name}: {defect.message}")
    print(f"data set: {options.out}")


def _positive(option: str, value: float | None) -> float | None:
    if value is not None and not 0.0 < value < float("inf"):
        raise GaitoptError(f"--{option}: found {value:g}; allowed: a positive number")
    return value


def _export(options: argparse.Namespace) -> None:
    from gaitopt.core.folders import check_new_or_empty
    from gaitopt.core.json import to_json
    from gaitopt.export.handover import Choices, prepare
    from gaitopt.optimise.executors import open_executor

    problem = _load(options)
    gait = problem.find_gait(options.gait, in_range=False)
    check_new_or_empty(options.out)
    choices = Choices(options.format, options.clip, options.slew, options.led_pin, options.samples)
    with open_executor("threads", options.workers) as executor:
        handover = prepare(problem, gait, choices, executor)
    exported = handover.write(options.out)
    if options.json:
        print(to_json(exported.to_dict()), end="")
    else:
        _print_export(exported)


def _completion(options: argparse.Namespace) -> None:
    from gaitopt.cli.completion import completion_script

    print(completion_script(build_parser(), options.shell), end="")


def _new(options: argparse.Namespace) -> None:
    from gaitopt.problem.draft import make_problem

    folder = options.out or Path(options.name)
    draft = make_problem(options.name, options.mjcf, folder)
    roles = draft.roles
    channels = ", ".join(channel.name for channel in draft.channels)
    print(f"channels: {channels}; marker: {roles.marker}; pads: {', '.join(roles.pads)}")
    for remark in roles.remarks:
        print(f"guessed: {remark}")
    print(f"wrote {folder / 'problem.toml'}: correct what is guessed, then")
    print(f"  gaitopt check {folder}")
    print(f"  gaitopt simulate {folder} first-guess --video {options.name}.mp4")
    print(f"  gaitopt optimise {folder}")


# --- tables -----------------------------------------------------------------------------------


def _print_rows(rows: list[dict[str, Any]], as_json: bool) -> None:
    from gaitopt.cli.display import print_rows
    from gaitopt.core.json import to_json

    if as_json:
        print(to_json({"rows": rows}), end="")
    else:
        print_rows(rows)


def _print_summary(summary: Summary) -> None:
    from math import isfinite

    from gaitopt.cli.display import print_table
    from gaitopt.core.quantities import figure

    rows = []
    for row in [summary.best, *summary.baselines]:
        met = "met" if row.constraints_met else "violated"
        low, speed, high = (
            f"{1e3 * value:.1f}" if isfinite(value) else "-"  # a gait that fails has no speed
            for value in (row.speed_ci90_m_s[0], row.speed_m_s, row.speed_ci90_m_s[1])
        )
        rows.append([row.name, figure(row.period_s), speed, f"{low} to {high}", met])
    print_table(["gait", "period [s]", "speed [mm/s]", "90 % interval", "constraints"], rows)


def _print_export(exported: Exported) -> None:
    for name, values in exported.from_datasheet.items():
        if values:
            print(f"{name}: from the datasheet, not measured: {', '.join(values)}")
    for lag in exported.lags:
        print(f"{lag.channel}: the servo falls up to {lag.angle_deg:.3g}° and {lag.time_s:.2g} s behind")
    replay = exported.replay
    ideal, replayed = 1e3 * replay.ideal_m_s, 1e3 * replay.replayed_m_s
    print(f"simulated: {ideal:.2f} mm/s as a gait, {replayed:.2f} mm/s as the servos will get it", end="")
    if replay.loss is None or replay.loss_ci90 is None:
        print()
    else:
        low, high = replay.loss_ci90
        print(f": a loss of {replay.loss:.1%} (90 % interval {low:.1%} to {high:.1%})")
    for warning in exported.warnings:
        print(f"warning: {warning}")
    for file in exported.files:
        print(file)
