"""The run folder of a diagnosis of a servo on a bench, as tests need it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from helpers import problem_folder

from gaitopt.effects.active import Values
from gaitopt.problem.problem import load_problem

LEARNT: Mapping[str, Values] = {
    "servo_gain": {"scale": 0.5, "target": "all"},
    "servo_trim": {"offset_rad": 0.05, "target": "servo"},
    "servo_stiction": {"torque_n_m": 0.01, "target": "servo"},
}


def bench_run(folder: Path) -> Path:
    """Write what `gaitopt correct` reads of a run folder: a problem with the effects that were learnt."""
    source = load_problem("servo-bench").source.parent
    problem_folder(folder, source, lambda content: content.update(model="servo-bench.xml"))
    problem = load_problem(folder).with_effects(LEARNT)
    (folder / "corrected.toml").write_text(problem.to_toml("servo-bench.xml"))
    (folder / "diagnosis.json").write_text("{}")
    return folder
