"""How well does a phone measure a tagged robot? Synthetic films over distance, blur and compression.

    python tests/studies/films.py --out results/films
    python tests/studies/films.py --out DIR --seconds 1 --only distance

Films ArcFold with a synthetic phone (1080p, rolling shutter, lens blur, noise, H.264), tracks the films, and
writes films.csv: for each film and signal the RMS error after alignment, the noise that was stated, and the
share of the frames with a value; and of each film the error of its time stamps and the focal length.
Rows that are there already are kept.

Cost: 10 min of one core.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from kept_table import KeptTable, Row
from phone import Walk

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.film.phone import Phone, shot
from gaitopt.report.film.stage import Stand, stage_of, truth, walk
from gaitopt.robot.signals import AXES, axis_of
from gaitopt.track.tracking import Tracker, track_film

GAITS = ("square-1s", "square-4s", "square-2s", "square-0.5s", "results/arcfold")
BEGIN_S = 0.8
USUAL = Phone(exposures=3)
DISTANCES = (0.5, 1.0, 1.5)


@dataclass(frozen=True)
class Case:
    """One film.

    Attributes:
        study: what is varied.
        name: what it is called.
        phone: the phone.
        distance: from the robot, m.
        size_mm: edge of the robot's tags, mm.
        gait: what the robot does.
    """

    study: str
    name: str
    phone: Phone = USUAL
    distance: float = 0.5
    size_mm: float = 20.0
    gait: str = GAITS[0]


def cases() -> Iterator[Case]:
    """Every film of the study."""
    usual = USUAL
    hand = replace(usual, shake_m=0.002, shake_deg=0.4)
    worse = {
        "lens blur 2 px": replace(usual, blur_px=2.0),
        "exposure 20 ms": replace(usual, exposure_s=0.02),
        "crf 32": replace(usual, crf=32),
    }
    for fps in (30.0, 60.0):
        for distance in DISTANCES:
            at = f"{distance:g} m, {fps:g} frames/s"
            yield Case("distance", f"stand, {at}", replace(usual, fps=fps), distance)
            yield Case("distance", f"hand, {at}", replace(hand, fps=fps), distance)
    for name, phone in worse.items():
        for distance in DISTANCES:
            yield Case("worse", f"{name}, {distance:g} m", phone, distance)
    for gait in GAITS[1:]:
        for distance in DISTANCES:
            yield Case("gaits", f"{gait}, {distance:g} m", usual, distance, gait=gait)
    for jitter in (0.003, 0.008):
        yield Case("clock", f"stamps vary by {1e3 * jitter:g} ms", replace(usual, jitter_s=jitter))
    for size in (15.0, 30.0):
        for distance in DISTANCES:
            yield Case("size", f"{size:g} mm, {distance:g} m", usual, distance, size)


def stand(distance: float) -> Stand:
    """A place in front of the robot, to its right, and above it: as low as people put a phone on a table."""
    high, side = math.radians(28.0), math.radians(15.0)
    level = distance * math.cos(high)
    place = (0.12 - level * math.sin(side), -0.04 - level * math.cos(side), 0.02 + distance * math.sin(high))
    return Stand(place, (0.12, -0.06, 0.02))


def tagged(size_mm: float) -> Problem:
    """ArcFold with tags of a size."""
    problem = load_problem("arcfold")
    tags = {n: tag.model_copy(update={"size_mm": size_mm}) for n, tag in problem.file.tags.items()}
    return replace(problem, file=problem.file.model_copy(update={"tags": tags}))


def filmed(case: Case, problem: Problem, seconds: float, folder: Path) -> Walk:
    """The film of a case, made unless it is there already, and what it shows."""
    name = re.sub(r"[^a-z0-9.]+", "-", f"{case.study} {case.name}".lower())
    path, known = folder / f"{name}.mp4", folder / f"{name}.npz"
    if not known.exists():
        folder.mkdir(parents=True, exist_ok=True)
        stage, motion = stage_of(problem), walk(problem, case.gait, BEGIN_S + seconds + 0.5)
        made = shot(path, stage, motion, stand(case.distance), case.phone, seconds, begin=BEGIN_S)
        true = truth(problem, stage, motion, made.times)
        np.savez(known, times=made.times - made.times[0], **true)
    with np.load(known) as shown:
        content = {key: shown[key] for key in shown.files}
    return Walk(path, content.pop("times"), content)


def rows(case: Case, seconds: float, folder: Path) -> list[Row]:
    """Film, track and compare."""
    problem = tagged(case.size_mm)
    walked = filmed(case, problem, seconds, folder)
    tags = {int(n): tag for n, tag in problem.file.tags.items()}
    try:
        found = track_film(walked.path, Tracker.of(problem, tags))
    except GaitoptError as error:
        return [{"signal": "none", "unit": str(error).removeprefix(f"{walked.path}: ")}]
    late = 1e3 * float(np.abs(found.time - walked.times).max())
    table = []
    for name, series in found.signals.items():
        away = series - walked.truth[name]
        scale = 1e3 if axis_of(name) in AXES else math.degrees(1.0)
        error = scale * float(np.sqrt(np.nanmean((away - np.nanmean(away)) ** 2)))
        table.append(
            {
                "signal": name,
                "unit": "mm" if axis_of(name) in AXES else "deg",
                "error": f"{error:.3f}",
                "stated": f"{scale * found.noise[name]:.3f}",
                "seen": f"{np.isfinite(series).mean():.3f}",
                "stamps_ms": f"{late:.3f}",
                "focal_px": f"{found.room.lens.focal:.1f}",
            }
        )
    return table


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--films", type=Path, help="keep the films here, and take those that are there")
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--only", default="distance,worse,gaits,clock", help="of: …, size")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(options.out / "films.csv", ("study", "film", "gait"))
    with tempfile.TemporaryDirectory() as temporary:
        films = options.films or Path(temporary)
        for case in cases():
            if case.study in options.only.split(","):
                key = {"study": case.study, "film": case.name, "gait": case.gait}
                table.fill(key, lambda case=case: rows(case, options.seconds, films))


if __name__ == "__main__":
    main()
