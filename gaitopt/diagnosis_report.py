"""The run folder of a diagnosis: its JSON, the problem and model it used, and one HTML page."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from gaitopt import diagnosis_plots as plots
from gaitopt.correction import Walked, walked_gaits
from gaitopt.diagnose.align import is_marker
from gaitopt.diagnose.blind import NOMINAL_FOLDER
from gaitopt.diagnose.dataset import load_dataset
from gaitopt.diagnose.diagnosis import Diagnosis, diagnose
from gaitopt.diagnose.where import COMPONENTS
from gaitopt.diagnose.words import answer, explanation
from gaitopt.files import write_text
from gaitopt.gait import write_gait
from gaitopt.model import nominal_mjcf
from gaitopt.problem import Problem, load_problem
from gaitopt.report import render, save_figures
from gaitopt.results import new_folder, to_json, write_into, write_problem
from gaitopt.rollout import Simulator

CORRECTED_FILE = "corrected.toml"
"""In a run folder: the problem with what was found switched on, where anything was."""

NEXT_FILE = "next.toml"
"""In a run folder: the gait to measure next."""


def diagnose_folders(
    folder: Path, diagnoses: Path, executor: Executor, note: Callable[[str, int], None]
) -> None:
    """Diagnose every case in a folder of blind cases that has no diagnosis yet, and write run folders."""
    problem = None
    for case in sorted(path for path in folder.glob("case-*") if path.is_dir()):
        out = diagnoses / case.name
        if (out / "diagnosis.json").is_file():
            continue
        if problem is None:
            problem = load_problem(folder / NOMINAL_FOLDER)
            simulator = Simulator.build(problem)
        note(f"diagnosing {case.name}", 0)
        dataset = load_dataset(case, problem, [name for name in simulator.signals if name])
        write_diagnosis(out, problem, diagnose(simulator, dataset, executor, 1, next_gait=False), None)


def write_diagnosis(
    path: Path | None, problem: Problem, diagnosis: Diagnosis, executor: Executor | None = None
) -> Path:
    """Write the run folder of a diagnosis, and return it; ``diagnosis.json`` comes last.

    Args:
        path: the folder; a new one by default.
        problem: the nominal problem.
        diagnosis: the diagnosis.
        executor: where gaits of the corrected robot are simulated; None to leave them out.

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
    walked: list[Walked] = []
    corrected = corrected_problem(problem, diagnosis)
    if diagnosis.found is not None and diagnosis.found.best is not None:
        pictures |= {
            "ranking": (plots.ranking(diagnosis.found), "What each effect leaves of the held-out trials."),
            "profile": (plots.profile(diagnosis.found), "The loss along the winner's parameter."),
            "corrected": (plots.corrected(diagnosis.found), "The marker's error before and after, held out."),
        }
    best = diagnosis.found.best if diagnosis.found is not None else None
    if best is not None and executor is not None:
        walked = walked_gaits(problem, problem.with_effects(best.settings), executor)
    content = diagnosis.to_dict() | {"explanation": explanation(diagnosis)}
    content["corrected"] = [row.to_dict() for row in walked]
    model = nominal_mjcf(problem)
    folder = new_folder(path, f"{problem.name}-diagnosis")
    write_problem(folder, problem, model)
    if corrected is not None:
        text = corrected.to_toml("model.xml")
        write_into(folder, CORRECTED_FILE, lambda file: write_text(file, text))
    if diagnosis.experiment is not None:
        gait = diagnosis.experiment.gait
        write_into(folder, NEXT_FILE, lambda file: write_gait(file, gait))
    page = render(
        "diagnosis.html",
        title=f"{problem.name}: measured against simulated",
        answer=answer(diagnosis),
        words=content["explanation"],
        tables=[
            *([_effects_table(content)] if content["effects"] else []),
            *([_walked_table(walked)] if walked else []),
            _where_table(content),
            _signal_table(diagnosis),
            _floor_table(diagnosis),
        ],
        figures=save_figures(folder, pictures),
        blocks=[],
    )
    write_into(folder, "report.html", lambda file: write_text(file, page))
    write_into(folder, "diagnosis.json", lambda file: write_text(file, to_json(content)))
    return folder


def corrected_problem(problem: Problem, diagnosis: Diagnosis) -> Problem | None:
    """Return the problem with the cause that was found switched on; None where none was."""
    found = diagnosis.found
    if found is None or found.best is None or not found.causes:
        return None
    return problem.with_effects(found.best.settings)


def _effects_table(content: dict[str, Any]) -> dict[str, Any]:
    rows = []
    for row in content["effects"][:12]:
        parameter, figures = next(iter(row["parameters"].items()))
        low, high = figures["ci90"]
        shrinkage = row["heldout_shrinkage"]
        rows.append(
            [
                row["name"],
                row["target"],
                f"{row['probability']:.1%}",
                f"{parameter} = {figures['value']:.4g}",
                f"{low:.4g} to {high:.4g}",
                "" if shrinkage is None else f"{shrinkage:.0%}",
                f"{row['heldout_left']:.2f}",
                f"{row['alike']:.3f}",
            ]
        )
    return {
        "title": "Which effect",
        "head": ["effect", "target", "probability", "fitted", "90 %", "shrinkage", "left", "alike"],
        "rows": rows,
        "note": "Shrinkage: how much of the marker's gap above the floor goes, on trials that the fit did "
        "not see. Left: whitened mean square of the worst trial, 1 for a right model. Alike: cosine "
        "between what the effect and the first one change, in floors; near 1 these trials can hardly tell "
        "them apart.",
    }


def _walked_table(walked: list[Walked]) -> dict[str, Any]:
    rows = [
        [row.name, f"{row.period_s:.3g} s", f"{1e3 * row.nominal_m_s:.1f}", f"{1e3 * row.corrected_m_s:.1f}"]
        for row in walked
    ]
    return {
        "title": "Gaits before and after the correction",
        "head": ["gait", "period", "nominal, mm/s", "corrected, mm/s"],
        "rows": rows,
        "note": "Forward speed over whole cycles, nominal scenario; corrected by the most probable cause, "
        "which may not be sure. A full search for the corrected robot: "
        f"gaitopt optimise {CORRECTED_FILE}.",
    }


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
