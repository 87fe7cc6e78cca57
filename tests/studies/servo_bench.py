"""How far a diagnosis of a real servo on a bench gets, by kind of command.

    python tests/studies/servo_bench.py RECORDINGS --out results/servo-bench

RECORDINGS is a folder as `bench_dataset` reads it. Its recordings are diagnosed as `gaitopt diagnose
servo-bench` does, with folds by command. OUT/recordings.md has the RMS error over recordings of each kind:
of the nominal servo, of the corrected one fitted to all recordings, and of the one whose fit did not see the
command. OUT/recordings.json has them for each recording, and the diagnosis' effects.

Cost: 3 to 5 min on two cores.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bench_dataset import write_dataset
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.core.progress import silent
from gaitopt.diagnose.diagnosis import DiagnosisRequest
from gaitopt.jobs.diagnose import Question
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import load_problem

KINDS: Mapping[str, Sequence[str]] = {
    "small steps": ("step-3deg", "step-9deg"),
    "large steps": ("step-99deg", "step-108deg"),
    "ramps": ("ramp",),
    "small squares": ("square",),
    "small random telegraphs": ("prbs-3deg", "prbs-9deg"),
    "large random telegraphs": ("prbs-108deg",),
    "triangles": ("triangle",),
    "drops": ("drop",),
}
"""Beginnings of the names of the recordings of each kind."""

FIXED = {
    "small steps": 0.021,
    "large steps": 0.052,
    "ramps": 0.028,
    "small squares": 0.027,
    "large random telegraphs": 0.066,
    "all but drops": 0.056,
}
"""RMS error, rad, of a structure of eight numbers fitted to the same recordings; from their README."""


def squares(found: Any) -> dict[str, dict[str, float]]:
    """Return the mean square of each recording's error, rad², before, fitted, and held out."""
    trial_set, best = found.trial_set, found.best
    errors: dict[str, NDArray[np.float64]] = {
        "nominal": found.nominal.angles,
        "fitted": best.together.robot.angles,
        "held_out": best.angles,
    }
    of_trial = trial_set.block_trials[trial_set.angle_blocks]
    names = [one.aligned.trial.name for one in trial_set.trials]
    return {
        name: {label: float(np.mean(left[of_trial == i] ** 2)) for label, left in errors.items()}
        for i, name in enumerate(names)
    }


def table(by_trial: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the table of RMS errors by kind."""
    groups = {
        kind: [name for name in by_trial if name.startswith(tuple(begins))] for kind, begins in KINDS.items()
    }
    groups["all but drops"] = [name for name in by_trial if not name.startswith("drop")]
    groups["all"] = list(by_trial)
    lines = [
        "| kind | recordings | nominal | eight numbers, fitted | fitted | held out |",
        "|---|---|---|---|---|---|",
    ]
    for kind, names in groups.items():
        if names:
            cells = [
                f"{np.sqrt(np.mean([by_trial[name][label] for name in names])):.3f}"
                for label in ("nominal", "fitted", "held_out")
            ]
            fixed = f"{FIXED[kind]:.3f}" if kind in FIXED else "–"
            lines.append(f"| {kind} | {len(names)} | {cells[0]} | {fixed} | {cells[1]} | **{cells[2]}** |")
    return lines


def main() -> None:
    """Diagnose the recordings and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("recordings", type=Path, help="folder of the tables")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(options.recordings, Path(folder) / "bench")
        request = DiagnosisRequest(seed=1, next_gait=False)
        question = Question.of(load_problem("servo-bench"), Path(folder) / "bench", request)
        began = time.monotonic()
        with open_executor("processes", None) as executor:
            diagnosis = question.answered(executor, silent)
        took = time.monotonic() - began
    content = diagnosis.to_dict()
    by_trial = squares(diagnosis.found)
    kept = ("verdict", "causes", "ambiguous_with", "effects", "misfit_trials", "gap_angles")
    record = {"wall_s": round(took, 1), "mean_squares": by_trial} | {key: content[key] for key in kept}
    write_text(options.out / "recordings.json", to_json(record))
    text = [*table(by_trial), "", f"Verdict: {content['verdict']}. {took:.0f} s on this machine."]
    write_text(options.out / "recordings.md", "\n".join(text) + "\n")
    print("\n".join(text))


if __name__ == "__main__":
    main()
