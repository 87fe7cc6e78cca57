"""The run folder of a diagnosis: its JSON, the problem and model it used, and one HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gaitopt import diagnosis_plots as plots
from gaitopt.diagnose.align import is_marker
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.where import COMPONENTS
from gaitopt.diagnose.words import answer, explanation
from gaitopt.files import write_text
from gaitopt.model import nominal_mjcf
from gaitopt.problem import Problem
from gaitopt.report import render, save_figures
from gaitopt.results import new_folder, to_json, write_into, write_problem


def write_diagnosis(path: Path | None, problem: Problem, diagnosis: Diagnosis) -> Path:
    """Write the run folder of a diagnosis, and return it; ``diagnosis.json`` comes last.

    Raises:
        GaitoptError: the folder holds something already, or cannot be written.
    """
    pictures = {
        "measured": (
            plots.measured_and_simulated(diagnosis),
            "Measured over simulated, moved to one origin, on the gait's clock. Crosses are samples that do "
            "not count; the defects below say why.",
        ),
        "components": (
            plots.components(diagnosis),
            "The gap of each signal and trial in multiples of its floor, and what it is made of.",
        ),
        "map": (
            plots.gap_map(diagnosis),
            "Where in the cycle the gap lies, drift removed, in multiples of the floor.",
        ),
    }
    content = diagnosis.to_dict() | {"explanation": explanation(diagnosis)}
    model = nominal_mjcf(problem)
    folder = new_folder(path, f"{problem.name}-diagnosis")
    write_problem(folder, problem, model)
    page = render(
        "diagnosis.html",
        title=f"{problem.name}: measured against simulated",
        answer=answer(diagnosis),
        words=content["explanation"],
        tables=[_where_table(content), _signal_table(diagnosis), _floor_table(diagnosis)],
        figures=save_figures(folder, pictures),
        blocks=[],
    )
    write_into(folder, "report.html", lambda file: write_text(file, page))
    write_into(folder, "diagnosis.json", lambda file: write_text(file, to_json(content)))
    return folder


def _where_table(content: dict[str, Any]) -> dict[str, Any]:
    rows = [
        [
            f"{row['trial']}: {row['signal']}",
            row["component"],
            f"{row['share']:.0%}",
            _amount(row["gap"], row["unit"]),
            f"{row['floors']:.1f}" if row["floors"] is not None else "",
        ]
        for row in content["where"][:12]
    ]
    return {
        "title": "Where the gap lies",
        "head": ["signal", "component", "share of the whole", "RMS", "floors"],
        "rows": rows,
        "note": "Drift: travel per cycle that the stride's size does not explain. Stride: size and shape "
        "of the motion inside a cycle, with the travel that goes with its size. Timing: the same motion "
        "later or earlier. Transient: before the steady motion. Noise: what differs from cycle to cycle. "
        "Shares are of the squared gap in floors, of the trials that count.",
    }


def _signal_table(diagnosis: Diagnosis) -> dict[str, Any]:
    rows = []
    for trial in diagnosis.trials:
        for name, part in trial.splits.items():
            unit = "m" if is_marker(name) else "rad"
            rows.append(
                [
                    f"{trial.name}: {name}",
                    *(_amount(travel, unit) for travel in part.travel),
                    f"{part.size:.2f}",
                    f"{1e3 * part.delay_s:+.0f} ms",
                    *(f"{part.squares[c] / (part.rms**2 or 1.0):.0%}" for c in COMPONENTS),
                ]
            )
    head = ["signal", "travel a cycle", "simulated", "size in a cycle", "delay", *COMPONENTS]
    return {"title": "Each signal", "head": head, "rows": rows, "note": ""}


def _floor_table(diagnosis: Diagnosis) -> dict[str, Any]:
    rows = []
    for trial in diagnosis.trials:
        for name, floor in trial.floors.items():
            unit = "m" if is_marker(name) else "rad"
            parts = (floor.noise, floor.spread, floor.repeats, floor.start_pose, floor.numerics, floor.clock)
            rows.append(
                [
                    f"{trial.name}: {name}",
                    _amount(trial.aligned.rms(name), unit),
                    _amount(floor.total, unit),
                    *("" if part is None else _amount(part, unit) for part in parts),
                ]
            )
    return {
        "title": "The floor",
        "head": ["signal", "gap", "floor", "noise", "cycles", "repeats", "start pose", "timestep", "clock"],
        "rows": rows,
        "note": "RMS. Noise, spread of the cycles and repeats from the data; start pose, timestep and what "
        "rounded time stamps leave open from the simulator at the fidelity used.",
    }


def _amount(value: float, unit: str) -> str:
    return f"{1e3 * value:.3g} mm" if unit == "m" else f"{value:.3g} rad"
