"""The plots and rows of a sweep: one gait over a range of one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gaitopt.core.files import write_text, write_with
from gaitopt.core.json import to_json
from gaitopt.optimise.sweep import SweepPoint, SweptPoint
from gaitopt.problem.problem import Problem
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.page import after_results, png, writer
from gaitopt.runs.folder import filled_folder
from gaitopt.simulation.rollout import Simulator


def write_sweep(
    path: Path | None, problem: Problem, points: Sequence[SweepPoint], rows: Sequence[SweptPoint]
) -> Path:
    """Write the overlaid plot, the separate plots and the rows of a sweep, and return their folder.

    The plots show the marker's path; a problem without a marker has none. The rows are written first.

    Args:
        path: a new or empty folder; by default a new one.
        problem: the robot.
        points: the problem and the gait at each value, each with its own name.
        rows: the result at each value.
    """
    with filled_folder(path, f"{problem.name}-sweep") as folder:
        write_text(folder / "sweep.json", to_json({"rows": [row.to_dict() for row in rows]}))
        if problem.roles.marker is not None:
            with after_results(folder, "sweep.json"):
                _write_plots(folder, problem, points)
    return folder


def _write_plots(folder: Path, problem: Problem, points: Sequence[SweepPoint]) -> None:
    simulators = [Simulator.build(point.problem) for point in points]
    gaits = [point.gait for point in points]
    duration = max(s.duration(gait) for s, gait in zip(simulators, gaits, strict=True))
    trajectories = {
        gait.name: simulator.run(gait, duration=duration)
        for simulator, gait in zip(simulators, gaits, strict=True)
    }
    figures = {
        "overlay": gait_figures.overlay(trajectories, problem.roles),
        "panels": gait_figures.panels(trajectories, problem.roles),
    }
    for name, drawn in figures.items():
        write_with(folder / f"{name}.png", writer(png(drawn)))
