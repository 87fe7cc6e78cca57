"""One self-contained HTML page per run: the answer, the table, the figures."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from gaitopt import plots
from gaitopt.files import write_with
from gaitopt.gait import Gait
from gaitopt.optimise.run import Optimised
from gaitopt.problem import Problem
from gaitopt.results import RunFolder, new_folder, write_into
from gaitopt.rollout import Simulator


def write_report(
    folder: RunFolder, problem: Problem, optimised: Optimised, summary: Mapping[str, Any]
) -> None:
    """Write ``report.html`` and ``figures/`` of a run of `optimise`."""
    gaits = {**problem.baselines, "best": optimised.best.gait}
    trajectories = nominal_trajectories(problem, gaits)
    speeds = {row["name"]: row["speed_m_s"] for row in summary["baselines"]}
    figures = {
        "position": (
            plots.overlay(trajectories, best="best"),
            "Forward position of the marker for each baseline and the optimised gait, on the nominal robot. "
            "The steeper the line, the faster the gait; steps back are slip.",
        ),
        "periods": (
            plots.panels(trajectories),
            "The same, one gait a panel: rises are strides, falls are slip.",
        ),
        "gait": (
            plots.gait_diagram(problem, optimised.best.gait, trajectories["best"]),
            "One cycle of the optimised gait: commanded and reached angle of each servo, and the load "
            "that each pad carries. A reached angle that lags far behind is the servo's limit.",
        ),
        "convergence": (
            plots.convergence(optimised.entries, speeds),
            "Mean speed of every gait evaluated, by method, the best so far by cost, and the baselines at "
            "the reference fidelity.",
        ),
    }
    text = render(
        "run.html",
        title=f"{problem.name}: optimised gait against hand-tuned gaits",
        answer=answer_of(summary),
        tables=[_speed_table(summary), _metric_table(summary)],
        figures=save_figures(folder.path, figures),
        blocks=[{"title": "The optimised gait (best.toml)", "text": optimised.best.gait.to_toml()}],
    )
    folder.file("report.html", lambda path: path.write_text(text, encoding="utf-8"))


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
    for name, figure in (("overlay", plots.overlay(trajectories)), ("panels", plots.panels(trajectories))):
        write_with(folder / f"{name}.png", _writer(_png(figure)))
    return folder


def nominal_trajectories(problem: Problem, gaits: Mapping[str, Gait]) -> dict[str, Any]:
    """Return a rollout of each gait on the nominal robot, all as long as the longest horizon."""
    simulator = Simulator.build(problem)
    duration = max(simulator.duration(gait) for gait in gaits.values())
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


def _speed_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    verified = summary["verified"]
    rows = [summary["best"], *summary["baselines"]]
    return {
        "title": "Optimised against hand-tuned",
        "mark_first": True,
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
        "note": "Means over the same scenarios; of drifts, the mean size.",
    }


def _number(value: float) -> str:
    return f"{value:.4g}"


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def _writer(data: bytes) -> Any:
    def write(path: Path) -> None:
        path.write_bytes(data)

    return write
