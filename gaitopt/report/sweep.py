"""The page, plots and rows of a sweep: one gait over a range of one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.optimise.sweep import Sweep, SweepPoint, SweptPoint
from gaitopt.problem.problem import Problem
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.figures import sweep as sweep_figures
from gaitopt.report.page import Page, Picture, Section, Table, after_results, save_figures
from gaitopt.report.words import ON_NOMINAL, fidelity_text, robot_text
from gaitopt.runs.folder import PAGE_FILE, filled_folder, write_into
from gaitopt.simulation.labels import label_of, shown
from gaitopt.simulation.rollout import Simulator

_COLUMNS = ("speed_m_s", "stride_m", "sideways_m_s", "slip_m", "cost_of_transport", "reached")
"""Metrics in the page's table, where the robot has them."""


def write_sweep(
    path: Path | None,
    problem: Problem,
    sweep: Sweep,
    points: Sequence[SweepPoint],
    rows: Sequence[SweptPoint],
) -> Path:
    """Write the page, the figures and the rows of a sweep, and return their folder.

    The figures show the marker's path; a problem without a marker has none. The rows are written first.

    Args:
        path: a new or empty folder; by default a new one.
        problem: the robot.
        sweep: the parameter and its values.
        points: the problem and the gait at each value, each with its own name.
        rows: the result at each value.
    """
    with filled_folder(path, f"{problem.name}-sweep") as folder:
        write_text(folder / "sweep.json", to_json({"rows": [row.to_dict() for row in rows]}))
        with after_results(folder, "sweep.json"):
            write_into(folder, PAGE_FILE, _page(folder, problem, sweep, points, rows).html())
    return folder


def _page(
    folder: Path, problem: Problem, sweep: Sweep, points: Sequence[SweepPoint], rows: Sequence[SweptPoint]
) -> Page:
    working = problem.simulation.working
    return Page(
        title=f"{problem.name}: sweep over {sweep.name}",
        answer=_answer(rows),
        asked={
            "Robot": robot_text(problem),
            "Values": ", ".join(f"{value:g}" for value in sweep.values),
            "Simulated": f"one rollout at each value {ON_NOMINAL} Here: "
            f"{fidelity_text(working.timestep_s, working.integrator)}",
        },
        sections=[
            *save_figures(folder, _pictures(problem, sweep, points, rows)),
            Section("Each value", table=_table(rows)),
        ],
    )


def _answer(rows: Sequence[SweptPoint]) -> str:
    speeds = {row.name: row.metrics["speed_m_s"] for row in rows if _has_speed(row)}
    if not speeds:
        return "No forward speed was measured at any value."
    best, worst = max(speeds, key=speeds.__getitem__), min(speeds, key=speeds.__getitem__)
    text = f"The gait is fastest at {best}: {1e3 * speeds[best]:.1f} mm/s"
    return text + (f". At {worst} it moves at {1e3 * speeds[worst]:.1f} mm/s." if worst != best else ".")


def _has_speed(row: SweptPoint) -> bool:
    return row.status == "ok" and "speed_m_s" in row.metrics


def _pictures(
    problem: Problem, sweep: Sweep, points: Sequence[SweepPoint], rows: Sequence[SweptPoint]
) -> dict[str, Picture]:
    pictures = {}
    if any(map(_has_speed, rows)):
        pictures["speeds"] = Picture(
            f"Speed over {sweep.name}",
            partial(sweep_figures.speeds, sweep, rows),
            "Forward speed at each value. Hollow marks break a limit of the problem.",
        )
    if problem.roles.marker is None:
        return pictures
    simulators = [Simulator.build(point.problem) for point in points]
    gaits = [point.gait for point in points]
    duration = max(s.duration(gait) for s, gait in zip(simulators, gaits, strict=True))
    trajectories = {
        gait.name: simulator.run(gait, duration=duration)
        for simulator, gait in zip(simulators, gaits, strict=True)
    }
    return pictures | {
        "overlay": Picture(
            "Position over time",
            partial(gait_figures.overlay, trajectories, problem.roles),
            "Forward position of the marker at each value. The steeper the line, the faster the gait.",
        ),
        "panels": Picture(
            "Each value by itself",
            partial(gait_figures.panels, trajectories, problem.roles),
            "The same with a panel for each value, each with its own scale.",
        ),
    }


def _table(rows: Sequence[SweptPoint]) -> Table:
    columns = [name for name in _COLUMNS if name in rows[0].metrics]
    return Table(
        head=["value", *map(label_of, columns), "limits"],
        rows=[
            [
                row.name,
                *(shown(name, row.metrics.get(name)) for name in columns),
                "kept" if row.constraints_met else ("broken" if row.status == "ok" else row.status),
            ]
            for row in rows
        ],
        note="sweep.json has every metric.",
        words=(len(columns) + 1,),
    )
