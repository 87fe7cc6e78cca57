"""One self-contained HTML page per run: what was asked, the answer, the tables, the figures."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jinja2
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from gaitopt import plots
from gaitopt.errors import GaitoptError
from gaitopt.files import write_text, write_with
from gaitopt.gait import Gait
from gaitopt.model import Robot
from gaitopt.optimise.run import Optimised
from gaitopt.optimise.sensitivity import GAIT_STEP, MODEL_STEP, Sensitivity
from gaitopt.problem import Objective, Problem
from gaitopt.results import RunFolder, new_folder, to_json, write_into
from gaitopt.rollout import Simulator
from gaitopt.trajectory import Trajectory

_DPI = 240
"""Of a figure 6.6 inches wide: enough for print."""

_LOOP_S = 3.0
"""A film in a report shows whole cycles that last at least this long."""

Pictures = dict[str, tuple[Figure, str]]


def write_report(
    folder: RunFolder,
    problem: Problem,
    optimised: Optimised,
    summary: Mapping[str, Any],
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
    films, notes = _film(folder.path, simulator, optimised, summary) if full else ([], [])
    best = optimised.best.gait
    pictures = _pictures(simulator, optimised, summary)
    pictures |= _front_picture(optimised) | _sensitivity_pictures(sensitive)
    content = {
        "title": f"{problem.name}: optimised gait against hand-tuned gaits",
        "asked": _asked(problem, summary),
        "answer": answer_of(summary),
        "notes": [*summary["notes"], *notes],
        "tables": [_speed_table(summary), _metric_table(summary)],
        "films": films,
        "figures": save_figures(folder.path, pictures),
        "blocks": [{"title": "The optimised gait (best.toml)", "text": best.to_toml()}],
    }
    if sensitive:
        rows = [asdict(one) for one in sensitive]
        folder.file("sensitivity.json", lambda path: write_text(path, to_json({"rows": rows})))
    text = render("run.html", **content)
    folder.file("report.html", lambda path: write_text(path, text))


def _pictures(simulator: Simulator, optimised: Optimised, summary: Mapping[str, Any]) -> Pictures:
    problem, best = simulator.problem, optimised.best.gait
    robot = Robot.of(simulator.models[0])
    trajectories = nominal_trajectories(problem, {"best": best, **problem.baselines})
    hand_tuned = {row["name"]: row["speed_m_s"] for row in summary["baselines"]}
    pictures: Pictures = {
        "speeds": (
            plots.speeds([summary["best"], *summary["baselines"]], best="best"),
            "Forward speed of the optimised gait and of each hand-tuned one, over scenarios that the search "
            "never saw. Bars whose intervals do not overlap differ by more than noise.",
        ),
        "position": (
            plots.overlay(trajectories, problem.roles, best="best"),
            "Forward position of the marker for each gait, on the nominal robot. The steeper the line, the "
            "faster the gait; steps back are slip.",
        ),
        "periods": (
            plots.panels(trajectories, problem.roles),
            "The same, one gait a panel: rises are strides, falls are slip.",
        ),
    }
    if trajectories["best"].status == "ok":
        pictures["gait"] = (
            plots.gait_diagram(problem, best, trajectories["best"], robot),
            "One cycle of the optimised gait. Grey: a pad holds the ground; orange: a loaded pad slips back, "
            "which costs travel. The bars below say which pad it is.",
        )
        pictures["angles"] = (
            plots.angles(problem, best, trajectories["best"], robot),
            "Commanded and reached angles of each servo with its range. Where the reached angle falls behind "
            "while the torque is at its limit, the servo is too weak or the gait too fast for it.",
        )
    pictures["convergence"] = (
        plots.convergence(optimised.entries, hand_tuned),
        "Speed of every gait evaluated, by method; stars are planned gaits, where the search started from "
        "some. Crosses violate a constraint; the best so far counts violations too, so it may step down to a "
        "slower gait that has none. Horizontal lines are the hand-tuned gaits.",
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
        "pareto": (
            plots.front(optimised.entries, optimised.front, baselines),
            "Speed against cost of transport (energy per weight and distance). A gait on the front is beaten "
            "by no other in both; its numbers are in pareto.csv, and each is a gait file in pareto/.",
        )
    }


def _sensitivity_pictures(sensitive: Sequence[Sensitivity]) -> Pictures:
    said = {
        "gait": (f"{GAIT_STEP:.0%} of its range", "its numbers", "what to set with care on the robot"),
        "model": (f"{MODEL_STEP:.0%} of its value", "the model's parameters", "what is worth measuring well"),
    }
    names = {"gait": "sensitivity", "model": "sensitivity-model"}
    pictures: Pictures = {}
    for kind, (step, numbers, lesson) in said.items():
        chosen = [one for one in sensitive if one.kind == kind]
        if chosen:
            pictures[names[kind]] = (
                plots.sensitivity(chosen, step),
                f"How the speed of the optimised gait changes when one of {numbers} moves by {step}, in the "
                f"mean over scenarios that are the same for all. Long bars are {lesson}; where the black "
                "interval crosses 0, up and down differ by no more than noise.",
            )
    return pictures


def _film(
    folder: Path, simulator: Simulator, optimised: Optimised, summary: Mapping[str, Any]
) -> tuple[list[dict[str, str]], list[str]]:
    """Film the winner beside the fastest baseline; where that cannot be, say why."""
    from gaitopt.video import take, write_film

    gaits = [optimised.best.gait]
    if summary["baselines"]:
        fastest = max(summary["baselines"], key=lambda row: row["speed_m_s"])
        gaits.append(simulator.problem.baselines[fastest["name"]])
    period = max(gait.period_s for gait in gaits)
    begin = simulator.problem.simulation.horizon.transient_s
    end = begin + period * max(1, round(_LOOP_S / period))
    try:
        takes = [take(simulator, gait, end) for gait in gaits]
        path = write_into(folder, "figures/walk.webp", lambda file: write_film(file, takes, begin, end))
    except GaitoptError as error:
        return [], [f"no film: {error}"]
    data = base64.b64encode(path.read_bytes()).decode()
    caption = (
        "The optimised gait" + (" beside the fastest hand-tuned one" if len(gaits) > 1 else "") + ", on the "
        "nominal robot, once it walks steadily. The camera follows; the stripes on the ground stand still."
    )
    return [{"name": "walk", "data": data, "caption": caption}], []


def save_figures(folder: Path, figures: Mapping[str, tuple[Figure, str]]) -> list[dict[str, str]]:
    """Write figures with their captions into ``figures/``, and return what a page needs to show them."""
    shown = []
    for name, (figure, caption) in figures.items():
        data = _png(figure)
        write_into(folder, f"figures/{name}.png", _writer(data))
        shown.append({"name": name, "data": base64.b64encode(data).decode(), "caption": caption})
    return shown


def render(template: str, **content: Any) -> str:
    """Return the page of a template."""
    loader = jinja2.PackageLoader("gaitopt")
    page = jinja2.Environment(autoescape=True, loader=loader).get_template(template)
    return page.render(**content)


def write_comparison(
    path: Path, problem: Problem, gaits: Sequence[Gait], rows: Sequence[Mapping[str, Any]], seed: int
) -> Path:
    """Write the page, the figures and the rows of a comparison, and return their folder."""
    folder = new_folder(path, f"{problem.name}-compare")
    names = [str(row["name"]) for row in rows]
    trajectories = nominal_trajectories(problem, dict(zip(names, gaits, strict=True)))
    pictures: Pictures = {
        "speeds": (
            plots.speeds(rows),
            "Mean forward speed of each gait over the same scenarios. Because they are the same, the paired "
            "difference in the table is sharper than these intervals.",
        ),
        "position": (
            plots.overlay(trajectories, problem.roles),
            "Forward position of the marker on the nominal robot: the steeper, the faster.",
        ),
    }
    text = render(
        "run.html",
        title=f"{problem.name}: gaits compared",
        asked=f"{len(gaits)} gaits over {problem.file.scenarios.verification} scenarios of {problem.name}, "
        f"seed {seed}, at {problem.simulation.working.timestep_s:g} s",
        answer=" ".join(verdicts(rows)) or f"{names[0]} alone: nothing to compare with.",
        tables=[_comparison_table(rows)],
        figures=save_figures(folder, pictures),
    )
    write_into(folder, "report.html", lambda file: write_text(file, text))
    write_into(folder, "compare.json", lambda file: write_text(file, to_json({"rows": rows})))
    return folder


def verdicts(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return one sentence for each gait after the first: how it differs, and whether by more than noise."""
    sentences = []
    for row in rows[1:]:
        low, high = (1e3 * end for end in row["difference_ci90_m_s"])
        verdict = "more than noise" if row["more_than_noise"] else "not more than noise"
        sentences.append(
            f"{row['name']} against {rows[0]['name']}: {1e3 * row['difference_m_s']:+.2f} mm/s "
            f"(90 % interval {low:+.2f} to {high:+.2f}), {verdict}."
        )
    return sentences


def write_audit(path: Path, problem: Problem, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write the page, the figures and the findings of an audit, and return their folder."""
    folder = new_folder(path, f"{problem.name}-check")
    trajectories = nominal_trajectories(problem, problem.baselines)
    shown = {name: one for name, one in trajectories.items() if one.status == "ok"}
    pictures: Pictures = {}
    if any(row["limit"] > 0.0 for row in rows):
        pictures["findings"] = (
            plots.findings(rows),
            "Each finding that has a limit, as a multiple of it. Shares that should be larger, such as the "
            "travel that a servo reaches, lie left of the line.",
        )
    if shown:
        pictures["position"] = (
            plots.overlay(shown, problem.roles),
            "Forward position of the marker: a robot that crawls goes up in even steps.",
        )
        pictures["height"] = (
            plots.panels(shown, problem.roles, axis=2),
            "Height of the marker over its start: leaps of many millimetres are flights, not steps.",
        )
    names = sorted({str(row["name"]) for row in rows})
    text = render(
        "run.html",
        title=f"{problem.name}: audit of the model",
        asked=f"{problem.name} at {problem.simulation.working.timestep_s:g} s, "
        f"{problem.simulation.working.integrator}, over {len(problem.baselines)} hand-tuned gaits",
        answer=f"{len(rows)} findings: {', '.join(names)}." if rows else "Nothing found.",
        tables=[_finding_table(rows)] if rows else [],
        figures=save_figures(folder, pictures),
    )
    write_into(folder, "report.html", lambda file: write_text(file, text))
    write_into(folder, "check.json", lambda file: write_text(file, to_json({"findings": rows})))
    return folder


def write_sweep(path: Path | None, problem: Problem, points: Sequence[tuple[Problem, Gait]]) -> Path:
    """Write the overlaid and the separate plots of a sweep, and return their folder."""
    folder = new_folder(path, f"{problem.name}-sweep")
    simulators = [Simulator.build(changed) for changed, _ in points]
    gaits = [gait for _, gait in points]
    duration = max(s.duration(gait) for s, gait in zip(simulators, gaits, strict=True))
    trajectories = {
        gait.name: simulator.run(gait, duration=duration)
        for simulator, gait in zip(simulators, gaits, strict=True)
    }
    roles = problem.roles
    figures = {"overlay": plots.overlay(trajectories, roles), "panels": plots.panels(trajectories, roles)}
    for name, figure in figures.items():
        write_with(folder / f"{name}.png", _writer(_png(figure)))
    return folder


def nominal_trajectories(problem: Problem, gaits: Mapping[str, Gait]) -> dict[str, Trajectory]:
    """Return a rollout of each gait on the nominal robot, all as long as the longest horizon."""
    simulator = Simulator.build(problem)
    duration = max((simulator.duration(gait) for gait in gaits.values()), default=0.0)
    return {name: simulator.run(gait, duration=duration) for name, gait in gaits.items()}


def answer_of(summary: Mapping[str, Any]) -> str:
    """Return the result of a run in one sentence."""
    best = summary["best"]
    speed, (low, high) = best["speed_m_s"], best["speed_ci90_m_s"]
    text = (
        f"The best gait crawls at {1e3 * speed:.1f} mm/s (90 % interval {1e3 * low:.1f} to {1e3 * high:.1f})"
    )
    ratio = summary["ratio_to_best_baseline"]
    if ratio is not None:
        fastest = max(summary["baselines"], key=lambda row: row["speed_m_s"])
        text += f", {ratio:.2f} times the fastest hand-tuned gait, {fastest['name']}"
    met = "meets every constraint" if best["constraints_met"] else "violates " + ", ".join(best["violations"])
    return f"{text}, and {met}."


def _asked(problem: Problem, summary: Mapping[str, Any]) -> str:
    objective = problem.file.objective
    terms = ", ".join(f"{'more' if w < 0.0 else 'less'} {name}" for name, w in objective.terms.items())
    limits = ", ".join(objective.constraints) or "nothing"
    started = "from planned gaits" if summary["warm_start"] else "cold"
    return (
        f"{problem.name}, seed {summary['seed']}: {summary['evaluations']} gaits by method "
        f"{summary['method']!r}, started {started}, for {terms}, with limits on {limits}{_rule(objective)}"
    )


def _rule(objective: Objective) -> str:
    share = objective.worse_share
    if share is None:
        return ""
    return f", by its {share:.0%} quantile over scenarios" if share else ", by its worst scenario"


def _speed_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    verified = summary["verified"]
    rows = [summary["best"], *summary["baselines"]]
    return {
        "title": "Optimised against hand-tuned",
        "mark_first": True,
        "text_last": True,
        "head": [
            "gait",
            "period [s]",
            "speed [mm/s]",
            "90 % interval",
            "worst case",
            "stride [mm]",
            "constraints",
        ],
        "rows": [
            [
                row["name"],
                f"{row['period_s']:.3g}",
                f"{1e3 * row['speed_m_s']:.1f}",
                " to ".join(f"{1e3 * end:.1f}" for end in row["speed_ci90_m_s"]),
                f"{1e3 * row['speed_worst_m_s']:.1f}",
                f"{1e3 * row['stride_m']:.1f}",
                "met" if row["constraints_met"] else "violated: " + ", ".join(row["violations"]),
            ]
            for row in rows
        ],
        "note": f"Mean over {verified['scenarios']} scenarios that the search never saw, at "
        f"{verified['timestep_s']:g} s, {verified['integrator']}.",
    }


def _metric_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    rows = [summary["best"], *summary["baselines"]]
    return {
        "title": "All metrics",
        "mark_first": False,
        "head": ["metric", *(row["name"] for row in rows)],
        "rows": [
            [name, *(_number(row["metrics"][name]) for row in rows)] for name in summary["best"]["metrics"]
        ],
        "note": "Means over the same scenarios; of drifts, the mean size. Units end the names.",
    }


def _comparison_table(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "title": "Over the same scenarios",
        "mark_first": False,
        "text_last": True,
        "head": [
            *("gait", "period [s]", "speed [mm/s]", "90 % interval", "difference [mm/s]"),
            *("90 % interval", "ratio", "more than noise", "constraints"),
        ],
        "rows": [
            [
                row["name"],
                f"{row['period_s']:.3g}",
                f"{1e3 * row['speed_m_s']:.2f}",
                " to ".join(f"{1e3 * end:.2f}" for end in row["speed_ci90_m_s"]),
                *(_against_first(row) if index else ["", "", "", ""]),
                "met" if row["constraints_met"] else "violated: " + ", ".join(row["violations"]),
            ]
            for index, row in enumerate(rows)
        ],
        "note": f"Differences and ratios are to {rows[0]['name']}, scenario by scenario.",
    }


def _against_first(row: Mapping[str, Any]) -> list[str]:
    return [
        f"{1e3 * row['difference_m_s']:+.2f}",
        " to ".join(f"{1e3 * end:+.2f}" for end in row["difference_ci90_m_s"]),
        "" if row["ratio"] is None else f"{row['ratio']:.2f}",
        "yes" if row["more_than_noise"] else "no",
    ]


def _finding_table(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "title": "Findings",
        "text_last": True,
        "head": ["finding", "gait", "value", "limit", "what it means"],
        "rows": [
            [row["name"], row["gait"], _number(row["value"]), _number(row["limit"]), row["message"]]
            for row in rows
        ],
        "note": "",
    }


def _number(value: float) -> str:
    return f"{value:.4g}"


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    plt.close(figure)  # of figures that pyplot keeps
    return buffer.getvalue()


def _writer(data: bytes) -> Any:
    def write(path: Path) -> None:
        path.write_bytes(data)

    return write
