"""The command line: arguments in, calls, text and exit code out."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from gaitopt.errors import GaitoptError

if TYPE_CHECKING:
    from gaitopt.gait import Gait
    from gaitopt.problem import Problem

DONE, STATED_PROBLEM, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    parser = build_parser()
    try:
        options = parser.parse_args(_canonical(sys.argv[1:] if arguments is None else list(arguments)))
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        options.run(options)
    except GaitoptError as problem:
        print(f"gaitopt: {problem}", file=sys.stderr)
        return STATED_PROBLEM
    except KeyboardInterrupt:
        print("gaitopt: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader went away; nothing is left to tell it
        return STATED_PROBLEM
    return DONE


def _canonical(arguments: list[str]) -> list[str]:
    """Accept the other spelling of the main command."""
    return ["optimise", *arguments[1:]] if arguments[:1] == ["optimize"] else arguments


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        print(f"gaitopt: {message}; see {self.prog} --help", file=sys.stderr)
        raise SystemExit(WRONG_USAGE)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of every command."""
    parser = _Parser(
        prog="gaitopt",
        description="Find better gaits for small crawling robots, compare them with hand-tuned ones.",
        epilog="example: gaitopt optimise arcfold",
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def command(name: str, run: Callable[[Any], None], about: str, example: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(
            name, help=about, description=about[0].upper() + about[1:] + ".", epilog=f"example: {example}"
        )
        sub.set_defaults(run=run)
        sub.add_argument("problem", metavar="PROBLEM", help="folder, problem TOML, or bundled name")
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
        "simulate", _simulate, "simulate one gait", "gaitopt simulate arcfold square-1s --csv walk.csv"
    )
    simulate.add_argument("gait", metavar="GAIT", help="baseline, gait file, exported table or run folder")
    simulate.add_argument("--csv", type=Path, metavar="F", help="write the time series here")
    simulate.add_argument("--json", action="store_true", help="print JSON and nothing else")

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
    compare.add_argument("--json", action="store_true", help="print JSON and nothing else")
    _add_worker_option(compare)

    check = command(
        "check",
        _check,
        "audit a model: what would make its gaits mean nothing on a real robot",
        "gaitopt check arcfold-published",
    )
    check.add_argument("--json", action="store_true", help="print JSON and nothing else")
    _add_worker_option(check)

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

    export = command(
        "export",
        _export,
        "write a gait as a table and a player for an ESP32 with RC servos, once it walks in simulation",
        "gaitopt export arcfold square-1s --format micropython --out walk",
    )
    _add_export_options(export)
    return parser


def _add_export_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("gait", metavar="GAIT", help="baseline, gait file, exported table or run folder")
    sub.add_argument(
        "--format", required=True, choices=("c", "arduino", "esp-idf", "micropython", "csv", "json"),
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
        "--executor", default="threads", help="threads, processes or serial (default: %(default)s)"
    )
    sub.add_argument("--resume", type=Path, metavar="DIR", help="go on with an interrupted run")
    sub.add_argument("--quiet", action="store_true", help="no progress display")
    _add_worker_option(sub)


def _add_worker_option(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--workers", type=int, metavar="N", help="rollouts at once (default: all cores)")


def _add_output_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--out", type=Path, metavar="DIR", help="run folder (default: a new one in results/runs)"
    )
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
    from gaitopt.problem import load_problem

    return load_problem(options.problem, dict(options.parameters))


def _optimise(options: argparse.Namespace) -> None:
    from gaitopt.display import progress_display
    from gaitopt.optimise.executors import open_executor
    from gaitopt.optimise.journal import Journal
    from gaitopt.optimise.run import optimise
    from gaitopt.report import answer_of, write_report
    from gaitopt.results import to_json

    folder, problem, request = _open_run(options)
    with folder:
        summary = folder.summary
        if summary is None:
            with (
                open_executor(options.executor, options.workers) as executor,
                progress_display(request.budget, quiet=options.quiet or options.json) as display,
            ):
                journal = Journal(folder.journal, problem)
                try:
                    optimised = optimise(problem, request, journal, executor, display)
                except KeyboardInterrupt:
                    executor.shutdown(wait=True, cancel_futures=True)
                    if folder.started:
                        _say_how_to_resume(folder.path, journal)
                    raise
            summary = folder.write_results(problem, optimised)
            write_report(folder, problem, optimised, summary)
        if options.json:
            print(to_json(summary), end="")
        else:
            _print_summary(summary)
            print(answer_of(summary))
            print(f"report: {folder.path / 'report.html'}")


def _open_run(options: argparse.Namespace) -> tuple[Any, Problem, Any]:
    from gaitopt.errors import nearest
    from gaitopt.optimise.run import DEFAULT_BUDGET, Request
    from gaitopt.optimise.study import METHODS
    from gaitopt.results import RunFolder

    if options.resume is not None:
        given = [
            n for n in ("budget", "seed", "method", "warm_start", "out") if getattr(options, n) is not None
        ]
        if given or options.parameters:
            name = (given or ["set"])[0].replace("_", "-")
            raise GaitoptError(f"--{name}: not with --resume, which takes it from {options.resume}")
        return RunFolder.reopen(options.resume)
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
    request = Request(seed, budget, method, options.warm_start is not False)
    return RunFolder.create(options.out, problem, request), problem, request


def _say_how_to_resume(path: Path, journal: Any) -> None:
    best = min(journal.entries, key=lambda entry: entry.evaluation.cost)
    speed = 1e3 * best.evaluation.metrics["speed_m_s"]
    print(
        f"gaitopt: stopped after {len(journal.entries)} gaits, best so far {speed:.1f} mm/s; "
        f"go on with: gaitopt optimise {path} --resume {path}",
        file=sys.stderr,
    )


def _plan(options: argparse.Namespace) -> None:
    from gaitopt.plan import Planner, PlanSettings, plan_rows
    from gaitopt.results import to_json

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


def _seed(value: int | None) -> int:
    if value is None:
        return 1
    if value < 0:
        raise GaitoptError(f"--seed: found {value}; allowed: 0 or more")
    return value


def _simulate(options: argparse.Namespace) -> None:
    from gaitopt.files import write_text
    from gaitopt.metrics import measure
    from gaitopt.model import Robot
    from gaitopt.rollout import Simulator

    problem = _load(options)
    gait = problem.find_gait(options.gait)
    simulator = Simulator.build(problem)
    trajectory = simulator.run(gait)
    if options.csv is not None:
        write_text(options.csv, trajectory.to_csv())
    metrics = measure(problem, gait, trajectory, Robot.of(simulator.models[0]))
    row = {"name": gait.name, "period_s": gait.period_s, "status": trajectory.status} | metrics
    _print_rows([row], options.json)


def _sweep(options: argparse.Namespace) -> None:
    from gaitopt.comparison import Sweep, sweep
    from gaitopt.files import write_text
    from gaitopt.optimise.executors import open_executor
    from gaitopt.report import write_sweep
    from gaitopt.results import to_json

    problem = _load(options)
    gait = _first_gait(problem, options.gait)
    points = Sweep.parse(options.over).points(problem, gait)
    with open_executor("threads", options.workers) as executor:
        rows = sweep(points, executor)
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
    from gaitopt.comparison import compare
    from gaitopt.objective import check_objective
    from gaitopt.optimise.executors import open_executor

    problem = _load(options)
    check_objective(problem)
    gaits = [problem.find_gait(name) for name in options.gaits]
    with open_executor("threads", options.workers) as executor:
        rows = compare(problem, gaits, _seed(options.seed), executor)
    _print_rows(rows, options.json)
    if not options.json:
        for row in rows[1:]:
            low, high = (1e3 * end for end in row["difference_ci90_m_s"])
            verdict = "more than noise" if row["more_than_noise"] else "not more than noise"
            print(
                f"{row['name']} against {rows[0]['name']}: {1e3 * row['difference_m_s']:+.2f} mm/s "
                f"(90 % interval {low:+.2f} to {high:+.2f}), {verdict}"
            )


def _check(options: argparse.Namespace) -> None:
    from gaitopt.check import check
    from gaitopt.display import note
    from gaitopt.optimise.executors import open_executor
    from gaitopt.results import to_json

    problem = _load(options)
    with open_executor("threads", options.workers) as executor:
        findings = check(problem, executor, (lambda _: None) if options.json else note)
    if options.json:
        print(to_json({"findings": [finding.to_dict() for finding in findings]}), end="")
        return
    if not findings:
        print(f"{problem.name}: nothing found")
    for finding in findings:
        where = f" at {finding.gait}" if finding.gait else ""
        print(f"{finding.name}{where}: {finding.message}")


def _model(options: argparse.Namespace) -> None:
    from gaitopt.files import write_text
    from gaitopt.model import nominal_mjcf

    write_text(options.out, nominal_mjcf(_load(options)))
    print(options.out)


def _command(options: argparse.Namespace) -> None:
    import math

    import numpy as np

    from gaitopt.files import csv_text, write_text
    from gaitopt.model import build_model
    from gaitopt.rollout import servo_commands

    for name in ("dt", "duration"):
        value = getattr(options, name)
        if not (math.isfinite(value) and value > 0.0):
            raise GaitoptError(f"--{name}: found {value}; allowed: a positive number of seconds")
    rows = math.ceil(options.duration / options.dt * (1.0 - 1e-12))
    if rows > 50_000_000:
        raise GaitoptError(f"--dt: found {options.dt:g}; {rows} rows are more than the 50 million allowed")
    problem = _load(options)
    build_model(problem)  # the channels are the model's actuators in order
    time = np.arange(rows) * options.dt
    targets = servo_commands(problem, problem.find_gait(options.gait), time)
    columns = {"t_s": time} | dict(zip(problem.channel_names, targets.T, strict=True))
    write_text(options.out, csv_text(columns))
    print(options.out)


def _export(options: argparse.Namespace) -> None:
    from gaitopt.export.handover import Choices, check_folder, prepare, write_folder
    from gaitopt.optimise.executors import open_executor
    from gaitopt.results import to_json

    problem = _load(options)
    gait = problem.find_gait(options.gait, in_range=False)
    check_folder(options.out)
    choices = Choices(options.format, options.clip, options.slew, options.led_pin, options.samples)
    with open_executor("threads", options.workers) as executor:
        handover = prepare(problem, gait, choices, executor)
    answer = handover.to_dict(write_folder(options.out, handover.files))
    if options.json:
        print(to_json(answer), end="")
    else:
        _print_export(answer)


# --- tables -----------------------------------------------------------------------------------


def _print_rows(rows: list[dict[str, Any]], as_json: bool) -> None:
    from gaitopt.display import print_rows
    from gaitopt.results import to_json

    if as_json:
        print(to_json({"rows": rows}), end="")
    else:
        print_rows(rows)


def _print_summary(summary: dict[str, Any]) -> None:
    from gaitopt.display import print_rows

    keys = (
        "name",
        "period_s",
        "speed_m_s",
        "speed_ci90_m_s",
        "speed_worst_m_s",
        "stride_m",
        "constraints_met",
    )
    rows = [summary["best"], *summary["baselines"]]
    print_rows([{key: row[key] for key in keys} for row in rows])


def _print_export(answer: dict[str, Any]) -> None:
    for name, values in answer["from_datasheet"].items():
        if values:
            print(f"{name}: from the datasheet, not measured: {', '.join(values)}")
    for name, lag in answer["lags"].items():
        print(f"{name}: the servo falls up to {lag['angle_deg']:.3g}° and {lag['time_s']:.2g} s behind")
    ideal, replayed = (1e3 * answer[f"{key}_speed_m_s"] for key in ("ideal", "replayed"))
    print(f"simulated: {ideal:.2f} mm/s as a gait, {replayed:.2f} mm/s as the servos will get it", end="")
    if answer["loss"] is None:
        print()
    else:
        low, high = answer["loss_ci90"]
        print(f": a loss of {answer['loss']:.1%} (90 % interval {low:.1%} to {high:.1%})")
    for warning in answer["warnings"]:
        print(f"warning: {warning}")
    for file in answer["files"]:
        print(file)
