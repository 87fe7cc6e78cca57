"""The reports of runs: the page, the figures and the files of a search, a comparison, an audit or a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_text, write_with
from gaitopt.core.json import to_json
from gaitopt.core.quantities import figure, label_of, shown, title_of
from gaitopt.gait.gait import Gait
from gaitopt.optimise.compare import ComparedGait
from gaitopt.optimise.ladder import TRUSTED, Rung
from gaitopt.optimise.run import Optimised
from gaitopt.optimise.sensitivity import GAIT_STEP, MODEL_STEP, Sensitivity
from gaitopt.optimise.sweep import SweepPoint
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Objective
from gaitopt.problem.robot import Robot
from gaitopt.report import settings as defaults
from gaitopt.report.figures import plots
from gaitopt.report.page import (
    Page,
    Picture,
    Section,
    Table,
    folded,
    image_section,
    png,
    save_figures,
    writer,
)
from gaitopt.robot.trajectory import Trajectory
from gaitopt.runs.folder import new_folder, write_into
from gaitopt.runs.run_folder import RunFolder
from gaitopt.runs.summary import GaitRow, Summary
from gaitopt.simulation.check import REMEDIES
from gaitopt.simulation.rollout import Simulator

Pictures = dict[str, Picture]


def write_report(
    folder: RunFolder,
    problem: Problem,
    optimised: Optimised,
    summary: Summary,
    full: bool = False,
    sensitive: Sequence[Sensitivity] = (),
) -> None:
    """Write ``report.html`` and ``figures/`` of a run of `optimise`.

    Args:
        folder: the run.
        problem: its problem.
        optimised: what was found.
        summary: the content of ``summary.json``.
        full: add what takes longer: a film of the winner.
        sensitive: the sensitivities of its speed, where they were asked for.
    """
    simulator = Simulator.build(problem)
    films, notes = film_section(folder.path, simulator, optimised, summary) if full else ([], [])
    pictures = _pictures(simulator, optimised, summary)
    pictures |= _front_picture(optimised) | _sensitivity_pictures(sensitive)
    if sensitive:
        rows = [asdict(one) for one in sensitive]
        folder.file("sensitivity.json", lambda path: write_text(path, to_json({"rows": rows})))
    page = Page(
        title=f"{problem.name}: optimised gait against hand-tuned gaits",
        answer=answer_of(summary),
        asked=_asked(problem, summary),
        tiles=_tiles(summary),
        notes=[*summary.notes, *notes],
        sections=[
            *films,
            Section("Optimised against hand-tuned", table=_speed_table(summary)),
            *save_figures(folder.path, pictures),
            Section("The optimised gait", table=gait_table(optimised.best.gait, "best.toml")),
            folded(Section("All metrics", table=_metric_table(summary))),
            Section("What next", commands=_next_commands(folder.path)),
        ],
    )
    folder.file("report.html", lambda path: write_text(path, page.html()))


def answer_of(summary: Summary) -> str:
    """Return the result of a run in one sentence."""
    best = summary.best
    speed, (low, high) = best.speed_m_s, best.speed_ci90_m_s
    if not _finite(speed):
        return f"The best gait of the search failed where it was verified: {best.status}."
    text = (
        f"The best gait crawls at {1e3 * speed:.1f} mm/s (90 % interval {1e3 * low:.1f} to {1e3 * high:.1f})"
    )
    ratio, fastest = summary.ratio_to_best_baseline, summary.fastest_baseline
    if ratio is not None and fastest is not None:
        text += f", {ratio:.2f} times the fastest hand-tuned gait, {fastest.name}"
    met = "meets every constraint" if best.constraints_met else f"violates {_names(best.violations)}"
    return f"{text}, and {met}."


def _pictures(simulator: Simulator, optimised: Optimised, summary: Summary) -> Pictures:
    problem, best = simulator.problem, optimised.best.gait
    robot = Robot.of(simulator.models[0])
    trajectories = nominal_trajectories(problem, {"best": best, **problem.baselines})
    hand_tuned = {row.name: row.speed_m_s for row in summary.baselines}
    pictures = {
        "speeds": Picture(
            "Speed",
            plots.speeds([summary.best, *summary.baselines], best="best"),
            "Forward speed of the optimised gait (orange) and of each hand-tuned one, over scenarios that "
            "the search never saw. Bars whose intervals do not overlap differ by more than noise.",
        ),
        "position": Picture(
            "Position over time",
            plots.overlay(trajectories, problem.roles, best="best"),
            "Forward position of the marker for each gait, on the nominal robot. The steeper the line, the "
            "faster the gait; steps back are slip, or the body folding.",
        ),
        "periods": Picture(
            "Each gait by itself",
            plots.panels(trajectories, problem.roles, best="best"),
            "The same, one gait a panel, each with a scale of its own: rises are strides, falls are slip or "
            "the body folding. Even steps mean a gait that repeats itself.",
        ),
    }
    if trajectories["best"].status == "ok":
        pictures["gait"] = Picture(
            "Gait diagram",
            plots.gait_diagram(problem, best, trajectories["best"], robot),
            "One cycle of the optimised gait. Grey ground: a pad holds; orange: a loaded pad slips back, "
            "which costs travel. The bars at the foot say which pad it is.",
        )
        pictures["angles"] = Picture(
            "Commanded and reached angles",
            plots.angles(problem, best, trajectories["best"], robot),
            "Commanded and reached angles of each servo with its range. Where the reached angle falls behind "
            "while the torque is at its limit (shaded), the servo is too weak for the gait, or the gait too "
            "fast for the servo.",
        )
    pictures["convergence"] = Picture(
        "Convergence of the search",
        plots.convergence(optimised.entries, hand_tuned),
        "Speed of every gait evaluated, by method; stars are planned gaits, where the search started from "
        "some. Crosses and hollow stars violate a constraint; the best so far counts violations too, so it "
        "may step down to a slower gait that has none. Horizontal lines are the hand-tuned gaits.",
    )
    return pictures


def _front_picture(optimised: Optimised) -> Pictures:
    if not optimised.request.pareto:
        return {}
    baselines = {
        found.gait.name: (found.speed, found.evaluation.metrics["cost_of_transport"])
        for found in optimised.baselines
    }
    return {
        "pareto": Picture(
            "Speed against cost of transport",
            plots.front(optimised.entries, optimised.front, baselines),
            "Speed against cost of transport (energy per weight and distance). A gait on the front is beaten "
            "by no other in both; its numbers are in pareto.csv, and each is a gait file in pareto/.",
        )
    }


def _sensitivity_pictures(sensitive: Sequence[Sensitivity]) -> Pictures:
    said = {
        "gait": (
            f"{100 * GAIT_STEP:.0f} % of its range",
            "its numbers",
            "what to set with care on the robot",
        ),
        "model": (
            f"{100 * MODEL_STEP:.0f} % of its value",
            "the model's parameters",
            "what is worth measuring well",
        ),
    }
    names = {
        "gait": ("sensitivity", "Sensitivity to the gait"),
        "model": ("sensitivity-model", "Sensitivity to the model"),
    }
    pictures: Pictures = {}
    for kind, (step, numbers, lesson) in said.items():
        chosen = [one for one in sensitive if one.kind == kind]
        if chosen:
            name, title = names[kind]
            pictures[name] = Picture(
                title,
                plots.sensitivity(chosen, step),
                f"How the speed of the optimised gait changes when one of {numbers} moves by {step}, in the "
                f"mean over scenarios that are the same for all. Long bars are {lesson}. The black mark is "
                "half the difference of up and down; where its interval crosses 0, they differ by no more "
                "than noise.",
            )
    return pictures


def film_section(
    folder: Path, simulator: Simulator, optimised: Optimised, summary: Summary
) -> tuple[list[Section], list[str]]:
    """Film the winner beside the fastest baseline; where that cannot be, say why."""
    from gaitopt.report.film.film import write_film
    from gaitopt.report.film.take import take

    gaits = [optimised.best.gait]
    fastest = summary.fastest_baseline
    if fastest is not None:
        gaits.append(simulator.problem.baselines[fastest.name])
    period = max(gait.period_s for gait in gaits)
    begin = simulator.problem.simulation.horizon.transient_s
    end = begin + period * max(1, round(defaults.DEFAULT.film_s / period))
    try:
        takes = [take(simulator, gait, end) for gait in gaits]
        path = write_into(folder, "figures/walk.webp", lambda file: write_film(file, takes, begin, end))
    except GaitoptError as error:
        return [], [f"No film: {error}"]
    caption = (
        "The optimised gait" + (" beside the fastest hand-tuned one" if len(gaits) > 1 else "") + ", on the "
        "nominal robot, once it walks steadily; the speed is of this one rollout. The camera follows; the "
        "stripes on the ground stand still."
    )
    return [image_section("The gait, filmed", path.read_bytes(), "webp", caption)], []


def write_comparison(
    path: Path, problem: Problem, gaits: Sequence[Gait], rows: Sequence[ComparedGait], seed: int
) -> Path:
    """Write the page, the figures and the rows of a comparison, and return their folder."""
    folder = new_folder(path, f"{problem.name}-compare")
    names = [row.name for row in rows]
    trajectories = nominal_trajectories(problem, dict(zip(names, gaits, strict=True)))
    pictures = {
        "speeds": Picture(
            "Speed",
            plots.speeds(rows),
            "Mean forward speed of each gait over the same scenarios. Because they are the same, the paired "
            "differences are sharper than these intervals.",
        )
    }
    if len(rows) > 1:
        pictures["differences"] = Picture(
            "Paired differences",
            plots.differences(rows),
            f"By how much each gait is faster than {names[0]}, scenario by scenario (dots), with the mean "
            "and its 90 % interval (black). An interval that crosses 0 is no more than noise.",
        )
    pictures["position"] = Picture(
        "Position over time",
        plots.overlay(trajectories, problem.roles),
        "Forward position of the marker on the nominal robot: the steeper, the faster.",
    )
    page = Page(
        title=f"{problem.name}: gaits compared",
        answer=" ".join(verdicts(rows)) or f"{names[0]} alone: nothing to compare with.",
        asked={
            "Gaits": ", ".join(names),
            "Scenarios": f"{problem.file.scenarios.verification} of {problem.name}, seed {seed}, the same "
            f"for each gait{_rule(problem.objective)}",
            "Simulated": f"at {figure(problem.simulation.working.timestep_s)} s, "
            f"{problem.simulation.working.integrator}",
        },
        sections=[
            Section("Over the same scenarios", table=_each_table(rows)),
            *([Section(f"Against {names[0]}", table=_paired_table(rows))] if len(rows) > 1 else []),
            *save_figures(folder, pictures),
            folded(Section("All metrics", table=_all_metrics(rows))),
        ],
    )
    write_into(folder, "report.html", lambda file: write_text(file, page.html()))
    content = to_json({"rows": [row.to_dict() for row in rows]})
    write_into(folder, "compare.json", lambda file: write_text(file, content))
    return folder


def verdicts(rows: Sequence[ComparedGait]) -> list[str]:
    """Return one sentence for each gait after the first: how it differs, and whether by more than noise."""
    return [_verdict(row, rows[0].name) for row in rows[1:]]


def _verdict(row: ComparedGait, first: str) -> str:
    difference, ends = 1e3 * row.difference_m_s, [1e3 * end for end in row.difference_ci90_m_s]
    if not all(map(_finite, (difference, *ends))):
        return f"{row.name} cannot be compared with {first}: a simulation failed."
    times = ""
    if row.ratio is not None and row.ratio_ci90 is not None:
        times = f", {row.ratio:.2f} times its speed ({_interval(row.ratio_ci90, '.2f', 1.0)})"
    if not row.more_than_noise:
        return (
            f"{row.name} differs from {first} by no more than noise: {difference:+.2f} mm/s "
            f"(90 % interval {ends[0]:+.2f} to {ends[1]:+.2f}){times}."
        )
    low, high = sorted(map(abs, ends))
    return (
        f"{row.name} is {'faster' if difference > 0.0 else 'slower'} than {first} by "
        f"{abs(difference):.2f} mm/s (90 % interval {low:.2f} to {high:.2f}){times}: more than noise."
    )


def _finite(value: float) -> bool:
    return abs(value) < float("inf")


def write_audit(path: Path, problem: Problem, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write the page, the figures and the findings of an audit, and return their folder."""
    folder = new_folder(path, f"{problem.name}-check")
    trajectories = nominal_trajectories(problem, problem.baselines)
    able = {name: one for name, one in trajectories.items() if one.status == "ok"}
    pictures: Pictures = {}
    if any(row["limit"] > 0.0 for row in rows):
        pictures["findings"] = Picture(
            "How far beyond the limits",
            plots.findings(rows),
            "How far each finding that has a limit lies beyond it: the longer, the worse. Of shares that "
            "should be larger, such as the travel that a servo reaches, it is the limit over the value.",
        )
    if able:
        pictures["position"] = Picture(
            "Position over time",
            plots.overlay(able, problem.roles),
            "Forward position of the marker: a robot that crawls goes up in even steps.",
        )
        pictures["height"] = Picture(
            "Height over time",
            plots.panels(able, problem.roles, axis=2),
            "Height of the marker over its start: leaps of many millimetres are flights, not steps.",
        )
    kinds = list(dict.fromkeys(str(row["name"]) for row in rows))
    found = f"{len(rows)} finding{'s' * (len(rows) != 1)} of {len(kinds)} kind{'s' * (len(kinds) != 1)}"
    page = Page(
        title=f"{problem.name}: audit of the model",
        answer=f"{found}{_where(rows, problem)}: {', '.join(map(title_of, kinds))}. Repair these before you "
        "trust a speed that they touch."
        if rows
        else "Nothing found: the model passes every check.",
        asked={
            "Checked": "rest at the start, inert parameters, self-collision, airtime, drift, chaos, timestep "
            "and servos that do not follow",
            "Gaits": ", ".join(problem.baselines) or "none",
            "Simulated": f"at {figure(problem.simulation.working.timestep_s)} s, "
            f"{problem.simulation.working.integrator}",
        },
        sections=[
            *([Section("What to do", table=_remedy_table(rows, kinds))] if rows else []),
            *save_figures(folder, pictures),
            *([Section("Every finding", table=_finding_table(rows))] if rows else []),
        ],
    )
    write_into(folder, "report.html", lambda file: write_text(file, page.html()))
    write_into(folder, "check.json", lambda file: write_text(file, to_json({"findings": rows})))
    return folder


def _where(rows: Sequence[Mapping[str, Any]], problem: Problem) -> str:
    """Return at which gaits findings show, in words, where the model and other gaits have none."""
    gaits = list(dict.fromkeys(row["gait"] for row in rows))
    some = "" not in gaits and len(gaits) < len(problem.baselines)
    return f", at {' and '.join(gaits)} alone" if some else ""


def write_sweep(path: Path | None, problem: Problem, points: Sequence[SweepPoint]) -> Path:
    """Write the overlaid and the separate plots of a sweep, and return their folder."""
    folder = new_folder(path, f"{problem.name}-sweep")
    simulators = [Simulator.build(point.problem) for point in points]
    gaits = [point.gait for point in points]
    duration = max(s.duration(gait) for s, gait in zip(simulators, gaits, strict=True))
    trajectories = {
        gait.name: simulator.run(gait, duration=duration)
        for simulator, gait in zip(simulators, gaits, strict=True)
    }
    roles = problem.roles
    figures = {"overlay": plots.overlay(trajectories, roles), "panels": plots.panels(trajectories, roles)}
    for name, drawn in figures.items():
        write_with(folder / f"{name}.png", writer(png(drawn)))
    return folder


def nominal_trajectories(problem: Problem, gaits: Mapping[str, Gait]) -> dict[str, Trajectory]:
    """Return a rollout of each gait on the nominal robot, all as long as the longest horizon."""
    simulator = Simulator.build(problem)
    duration = max((simulator.duration(gait) for gait in gaits.values()), default=0.0)
    return {name: simulator.run(gait, duration=duration) for name, gait in gaits.items()}


# --- what is asked and answered -----------------------------------------------------------------


def _asked(problem: Problem, summary: Summary) -> dict[str, str]:
    objective, verified = problem.objective, summary.verified
    terms = (f"{'more' if w < 0.0 else 'less'} {title_of(name)}" for name, w in objective.terms.items())
    started = "from planned gaits" if summary.warm_start else "cold"
    return {
        "Robot": f"{problem.name}{': ' * bool(problem.file.description)}{problem.file.description}",
        "For": f"{', '.join(terms)}{_rule(objective)}",
        "Limits on": _names(objective.constraints) or "nothing",
        "Search": f"{summary.evaluations} gaits, method {summary.method}, started {started}, seed "
        f"{summary.seed}; {summary.simulated_s:.0f} s simulated in {summary.wall_s:.0f} s",
        "Fidelity ladder": _laddered(summary.fidelity_ladder),
        "Verified": f"over {verified.scenarios} scenarios that the search never saw, at "
        f"{figure(verified.timestep_s)} s, {verified.integrator}",
    }


def _laddered(rungs: Sequence[Rung]) -> str:
    """Return which cheaper rungs were measured, how well they rank and whether they were used."""
    said = []
    for rung in rungs:
        ranks = f"rank correlation {rung.rank_correlation:.3f}"
        lower = f"{figure(rung.timestep_s)} s steps, {figure(rung.measured_s)} s measured"
        fate = "used" if rung.used else f"refused: below {TRUSTED}"
        said.append(f"{rung.name} ({lower}): {ranks}, {fate}")
    return "; ".join(said) or "none measured, every gait was judged at the working fidelity"


def _rule(objective: Objective) -> str:
    share = objective.worse_share
    if share is None:
        return ""
    return f", by its {100 * share:.0f} % quantile over scenarios" if share else ", by its worst scenario"


def _tiles(summary: Summary) -> list[tuple[str, str]]:
    best = summary.best
    low, high = (1e3 * end for end in best.speed_ci90_m_s)
    tiles = [
        (f"{1e3 * best.speed_m_s:.1f} mm/s", f"forward speed, 90 % interval {low:.1f} to {high:.1f}"),
        (f"{figure(best.period_s)} s", f"period; {1e3 * best.stride_m:.1f} mm a stride"),
    ]
    ratio, fastest = summary.ratio_to_best_baseline, summary.fastest_baseline
    if ratio is not None and fastest is not None:
        tiles.insert(1, (f"{ratio:.2f} times", f"the speed of {fastest.name}"))
    met = "met" if best.constraints_met else "violated"
    return [
        *tiles,
        (met, "constraints, in the mean" if best.constraints_met else _names(best.violations)),
    ]


def _next_commands(folder: Path) -> list[str]:
    return [
        f"gaitopt simulate {folder} {folder} --video walk.mp4",
        f"gaitopt export {folder} {folder} --format micropython --out player",
        f"gaitopt diagnose {folder} trials",
    ]


def _names(metrics: Mapping[str, object]) -> str:
    return ", ".join(title_of(name) for name in metrics)


# --- tables -------------------------------------------------------------------------------------


def _speed_table(summary: Summary) -> Table:
    rows = [summary.best, *summary.baselines]
    verified = summary.verified
    return Table(
        head=[
            *("gait", "period [s]", "speed [mm/s]", "90 % interval", "worst scenario"),
            *("stride [mm]", "cost of transport", "constraints"),
        ],
        rows=[
            [
                row.name,
                figure(row.period_s),
                f"{1e3 * row.speed_m_s:.1f}",
                _interval(row.speed_ci90_m_s, ".1f"),
                f"{1e3 * row.speed_worst_m_s:.1f}",
                f"{1e3 * row.stride_m:.1f}",
                f"{row.metrics['cost_of_transport']:.2f}",
                _constraints(row),
            ]
            for row in rows
        ],
        note=f"Mean over {verified.scenarios} scenarios that the search never saw.",
        mark_first=True,
        words=(7,),
    )


def _each_table(rows: Sequence[ComparedGait]) -> Table:
    return Table(
        head=["gait", "period [s]", "speed [mm/s]", "90 % interval", "worst scenario", "constraints"],
        rows=[
            [
                row.name,
                figure(row.period_s),
                f"{1e3 * row.speed_m_s:.2f}",
                _interval(row.speed_ci90_m_s, ".2f"),
                f"{1e3 * row.speed_worst_m_s:.2f}",
                _constraints(row),
            ]
            for row in rows
        ],
        words=(5,),
    )


def _paired_table(rows: Sequence[ComparedGait]) -> Table:
    return Table(
        head=["gait", "difference [mm/s]", "90 % interval", "ratio", "90 % interval", "more than noise"],
        rows=[
            [
                row.name,
                f"{1e3 * row.difference_m_s:+.2f}",
                _interval(row.difference_ci90_m_s, "+.2f"),
                "–" if row.ratio is None else f"{row.ratio:.2f}",
                "–" if row.ratio_ci90 is None else _interval(row.ratio_ci90, ".2f", 1.0),
                "yes" if row.more_than_noise else "no",
            ]
            for row in rows[1:]
        ],
        note=f"To {rows[0].name}, scenario by scenario: what scenarios do to both gaits cancels.",
    )


def _interval(ends: Sequence[float], form: str, scale: float = 1e3) -> str:
    return " to ".join(format(scale * end, form) for end in ends)


def _constraints(row: GaitRow | ComparedGait) -> str:
    return "met" if row.constraints_met else f"violated: {_names(row.violations) or row.status}"


def _metric_table(summary: Summary) -> Table:
    rows = [summary.best, *summary.baselines]
    return _all_metrics(rows)


def _all_metrics(rows: Sequence[GaitRow | ComparedGait]) -> Table:
    return Table(
        head=["metric", *(row.name for row in rows)],
        rows=[
            [label_of(name), *(shown(name, row.metrics[name]) for row in rows)] for name in rows[0].metrics
        ],
        note="Means over the same scenarios; of drifts, the mean size. ∞: a square wave commands a step.",
    )


def gait_table(gait: Gait, file: str) -> Table:
    """Return a gait's numbers, rounded, with the file that has them all."""
    return Table(
        head=["servo", "duty [%]", "phase [cycles]", "from [°]", "to [°]", "smoothing"],
        rows=[
            [
                name,
                f"{100 * channel.duty:.1f}",
                f"{channel.phase:.3f}",
                f"{channel.offset_deg:.1f}",
                f"{channel.offset_deg + channel.amplitude_deg:.1f}",
                f"{channel.smoothing:.2f}",
            ]
            for name, channel in gait.channels.items()
        ],
        note=f"Period {figure(gait.period_s)} s. For its duty's share of each cycle a servo is at the second "
        f"angle, else at the first; smoothing 0 is a square wave. {file} has every digit.",
    )


def _remedy_table(rows: Sequence[Mapping[str, Any]], kinds: Sequence[str]) -> Table:
    count = {kind: sum(row["name"] == kind for row in rows) for kind in kinds}
    return Table(
        head=["finding", "times", "what to do"],
        rows=[[title_of(kind), str(count[kind]), REMEDIES.get(kind, "")] for kind in kinds],
        words=(2,),
    )


def _finding_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table(
        head=["finding", "gait", "over its limit", "what was seen"],
        rows=[
            [
                title_of(row["name"]),
                row["gait"] or "–",
                f"{figure(plots.beyond(row['value'], row['limit']))} times" if row["limit"] > 0.0 else "–",
                row["message"],
            ]
            for row in rows
        ],
        note="check.json has the values and the limits.",
        words=(3,),
    )
