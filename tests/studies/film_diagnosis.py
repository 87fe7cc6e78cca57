"""Does a diagnosis from a phone's films do as well as one from clean signals with the same noise?

    python tests/studies/film_diagnosis.py --out results/films
    python tests/studies/film_diagnosis.py --out DIR --films DIR --only torque

Robots with a sealed error walk two gaits before a synthetic phone on a stand (1080p, 30 frames/s, 0.5 m).
Each is diagnosed three times: from the tracked films; from the true signals at the same times, with white
noise as large as tracking states; and from the true marker alone with that noise. Writes diagnoses.csv; rows
that are there already are kept.

Cost: 20 to 45 min of one core.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from films import USUAL, stand
from kept_table import KeptTable, Row

from gaitopt.core.streams import seeded
from gaitopt.diagnose.record.export import ImportOptions, Motion
from gaitopt.diagnose.record.importing import Recording, write_recordings
from gaitopt.effects.active import Tables
from gaitopt.jobs.diagnose import diagnose
from gaitopt.jobs.track import track
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.film.phone import shot
from gaitopt.report.film.stage import stage_of, truth, walk
from gaitopt.robot.signals import MARKER

SEALED: dict[str, dict[str, Tables]] = {
    "torque": {"servo_torque_limit": {"limit_n_m": 0.12}},
    "direction": {"friction_direction": {"ratio": 2.0}},
    "timing": {"channel_timing": {"target": "foot2", "delay_s": 0.06}},
}
GAITS = {"square-1s": 2.2, "square-0.5s": 1.2}
"""Seconds that are filmed of each gait: two cycles and a bit. Each film begins with the gait."""

KINDS = ("films", "clean", "marker")

Array = NDArray[np.float64]


def films_of(problem: Problem, folder: Path) -> None:
    """Film a robot, and keep what the films show."""
    folder.mkdir(parents=True, exist_ok=True)
    for gait, seconds in GAITS.items():
        known = folder / f"{gait}.npz"
        if not known.exists():
            stage, motion = stage_of(problem), walk(problem, gait, seconds + 0.2)
            made = shot(folder / f"{gait}.mp4", stage, motion, stand(0.5), USUAL, seconds, begin=0.02)
            np.savez(known, allow_pickle=False, times=made.times, **truth(problem, stage, motion, made.times))


def shown(folder: Path, gait: str) -> dict[str, Array]:
    """What a film shows."""
    with np.load(folder / f"{gait}.npz") as content:
        return {name: content[name] for name in content.files}


def clean(folder: Path, noise: Mapping[str, Mapping[str, float]], out: Path, names: object = None) -> None:
    """Write the true signals as a data set, with white noise."""
    read = []
    for number, gait in enumerate(GAITS):
        true, rng = shown(folder, gait), seeded(11, number)
        times = true.pop("times")
        signals = {
            name: true[name] + size * rng.standard_normal(len(times))
            for name, size in noise[gait].items()
            if names is None or name in MARKER
        }
        read.append(Recording(Path(f"{gait}.mp4"), "film", Motion(times - times[0], signals, fps=30.0)))
    write_recordings(read, list(GAITS), out, ImportOptions(), load_problem("arcfold"))


def tracked(name: str, keep: Path) -> Path:
    """Film a sealed robot, and return the folder with a data set of each kind."""
    nominal, folder = load_problem("arcfold"), keep / name
    films_of(nominal.with_effects(SEALED[name]), folder)
    sets = folder / "sets"
    if not (sets / "marker").exists():
        shutil.rmtree(sets, ignore_errors=True)
        done = track([folder / f"{gait}.mp4" for gait in GAITS], nominal, list(GAITS), sets / "films")
        noise = {gait: film.noise for gait, film in zip(GAITS, done.films, strict=True)}
        clean(folder, noise, sets / "clean")
        clean(folder, noise, sets / "marker", MARKER)
    return sets


def rows(name: str, kind: str, keep: Path) -> list[Row]:
    """Diagnose a sealed robot from one kind of data."""
    found = diagnose(load_problem("arcfold"), tracked(name, keep) / kind, next_gait=False, workers=1)
    content: dict[str, Any] = found.diagnosis.to_dict()
    effects = {row["name"]: row for row in content["effects"]}
    (true,) = SEALED[name]
    gap = content["gap"]
    return [
        {
            "verdict": str(content["verdict"]),
            "causes": " ".join(content["causes"]),
            "ambiguous_with": " ".join(content["ambiguous_with"]),
            "probability": f"{effects[true]['probability']:.2f}" if true in effects else "0",
            "values": str(effects[true]["parameters"]) if true in effects else "",
            "before_mm": f"{1e3 * gap['heldout_before_m']:.2f}",
            "after_mm": f"{1e3 * gap['heldout_after_m']:.2f}",
            "floor_mm": f"{1e3 * gap['floor_m']:.2f}",
        }
    ]


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--films", type=Path, help="keep the films here, and take those that are there")
    parser.add_argument("--only", default=",".join(SEALED), help="of these")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(options.out / "diagnoses.csv", ("sealed", "data"))
    with tempfile.TemporaryDirectory() as temporary:
        for kind in KINDS:
            for name in options.only.split(","):
                key = {"sealed": name, "data": kind}
                table.fill(key, partial(rows, name, kind, options.films or Path(temporary)))


if __name__ == "__main__":
    main()
