"""How well does a phone measure a tagged robot? Synthetic films over distance, blur and compression.

    python tests/studies/films.py --out results/films
    python tests/studies/films.py --out DIR --seconds 1 --only distance --gaits square-4s

Films ArcFold with a synthetic phone (1080p, rolling shutter, lens blur, noise, H.264), tracks the films, and
writes films.csv: for each film and signal the RMS error after alignment, the noise that was stated, and the
share of the frames with a value; and of each film the error of its time stamps and the focal length.
Rows that are there already are kept.

Cost: 2 h of one core.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from kept_table import KeptTable, Row
from phone import Phone, shot
from stages import Stand, stage_of, truth, walk

from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.signals import AXES, axis_of
from gaitopt.track.tracking import Tracker, track_film

GAITS = ("square-4s", "square-2s", "square-1s", "square-0.5s")
BEGIN_S = 0.8
USUAL = Phone(exposures=4)


@dataclass(frozen=True)
class Case:
    """One film.

    Attributes:
        study: what is varied.
        name: what it is called.
        phone: the phone.
        distance: from the robot, m.
        size_mm: edge of the robot's tags, mm.
    """

    study: str
    name: str
    phone: Phone = USUAL
    distance: float = 0.5
    size_mm: float = 20.0


def cases() -> Iterator[Case]:
    """Every film of the study, of one gait."""
    usual = USUAL
    hand = replace(usual, shake_m=0.002, shake_deg=0.4)
    for fps in (30.0, 60.0):
        for distance in (0.5, 0.75, 1.0, 1.5):
            at = f"{distance:g} m, {fps:g} frames/s"
            yield Case("distance", f"stand, {at}", replace(usual, fps=fps), distance)
            yield Case("distance", f"hand, {at}", replace(hand, fps=fps), distance)
    for size in (15.0, 30.0):
        for distance in (0.5, 1.0, 1.5):
            yield Case("size", f"{size:g} mm, {distance:g} m", usual, distance, size)
    for blur in (0.4, 1.2, 2.0, 3.0):
        yield Case("blur", f"lens {blur:g} px", replace(usual, blur_px=blur))
    for exposure in (0.002, 0.012, 0.02):
        yield Case("blur", f"exposure {1e3 * exposure:g} ms", replace(usual, exposure_s=exposure))
    for readout in (0.0, 0.02):
        yield Case("shutter", f"readout {1e3 * readout:g} ms", replace(usual, readout_s=readout))
    for crf in (15, 26, 32, 38):
        yield Case("compression", f"crf {crf}", replace(usual, crf=crf))
    for jitter in (0.003, 0.008):
        yield Case("clock", f"stamps vary by {1e3 * jitter:g} ms", replace(usual, jitter_s=jitter))


def stand(distance: float) -> Stand:
    """A place in front of the robot, to its right, and above it."""
    high, side = math.radians(28.0), math.radians(15.0)
    level = distance * math.cos(high)
    place = (0.12 - level * math.sin(side), -0.04 - level * math.cos(side), 0.02 + distance * math.sin(high))
    return Stand(place, (0.12, -0.06, 0.02))


def tagged(size_mm: float) -> Problem:
    """ArcFold with tags of a size."""
    problem = load_problem("arcfold")
    tags = {n: tag.model_copy(update={"size_mm": size_mm}) for n, tag in problem.file.tags.items()}
    return replace(problem, file=problem.file.model_copy(update={"tags": tags}))


def rows(case: Case, gait: str, seconds: float) -> list[Row]:
    """Film, track and compare."""
    problem = tagged(case.size_mm)
    stage, motion = stage_of(problem), walk(problem, gait, BEGIN_S + seconds + 0.5)
    with tempfile.TemporaryDirectory() as folder:
        made = shot(
            Path(folder) / "film.mp4", stage, motion, stand(case.distance), case.phone, seconds, begin=BEGIN_S
        )
        tags = {int(n): tag for n, tag in problem.file.tags.items()}
        found = track_film(made.path, Tracker.of(problem, tags))
    true = truth(problem, stage, motion, made.times)
    late = 1e3 * float(np.abs(found.time - (made.times - made.times[0])).max())
    table = []
    for name, series in found.signals.items():
        away = series - true[name]
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
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument(
        "--only", help="one of the studies: distance, size, blur, shutter, compression, clock"
    )
    parser.add_argument("--gaits", default=",".join(GAITS))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(options.out / "films.csv", ("study", "film", "gait"))
    for gait in options.gaits.split(","):
        for case in cases():
            if options.only in (None, case.study):
                key = {"study": case.study, "film": case.name, "gait": gait}
                table.fill(key, lambda case=case, gait=gait: rows(case, gait, options.seconds))


if __name__ == "__main__":
    main()
