"""How well does a phone measure a tagged robot? Synthetic films over distance, blur and compression.

    python tests/studies/films.py --out results/films
    python tests/studies/films.py --out DIR --seconds 1 --only distance

Films ArcFold with a synthetic phone (1080p, rolling shutter, lens blur, noise, H.264), tracks the films, and
writes films.csv: for each film and signal the RMS error after alignment, the noise that was stated, the share
of the frames with a value, and how many values are ten times as far off as was stated; and of each film the
error of its time stamps, the focal length, the readout, its bit rate, and how many tags were kept that are
not where they were found. Rows that are there already are kept.

Cost: 17 min of one core.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from kept_table import KeptTable, Row
from phone import Walk

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import seeded
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.film.phone import Filmed, Phone, shot
from gaitopt.report.film.stage import Stage, Stand, stage_of, truth, walk
from gaitopt.robot.signals import AXES, axis_of
from gaitopt.track.found import FilmTrack
from gaitopt.track.lens import Lens
from gaitopt.track.opencv import opencv
from gaitopt.track.tracking import Tracker, track_film

GAITS = ("square-1s", "square-4s", "square-2s", "square-0.5s", "results/arcfold")
BEGIN_S = 0.8
USUAL = Phone(exposures=9)
DISTANCES = (0.5, 1.0, 1.5)
STUDIES = ("distance", "decoys", "size", "low", "gaits", "worse", "clock")


HIGH_DEG = 45.0
"""How high the camera stands, as `gaitopt film` has it by default."""

_FAR_PX, _SIGMAS = 3.0, 10.0
"""A tag is false that is kept this far from where it is, a value that is so many standard deviations off."""

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]


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
        high_deg: how high the camera stands, degrees.
        hidden: changes a picture, before it is compressed.
    """

    study: str
    name: str
    phone: Phone = USUAL
    distance: float = 0.5
    size_mm: float = 20.0
    gait: str = GAITS[0]
    high_deg: float = HIGH_DEG
    hidden: Callable[[float, Picture], Picture] | None = None


def cases() -> Iterator[Case]:
    """Every film of the study."""
    usual = USUAL
    hand = replace(usual, shake_m=0.002, shake_deg=0.4)
    worse = {
        "lens blur 2 px": replace(usual, blur_px=2.0),
        "exposure 20 ms": replace(usual, exposure_s=0.02),
        "70 Mbit/s": replace(usual, bit_rate=70e6),
        "4 Mbit/s": replace(usual, bit_rate=4e6),
        "1 Mbit/s": replace(usual, bit_rate=1e6),
    }
    for fps in (30.0, 60.0):
        for distance in DISTANCES:
            at = f"{distance:g} m, {fps:g} frames/s"
            yield Case("distance", f"stand, {at}", replace(usual, fps=fps), distance)
            yield Case("distance", f"hand, {at}", replace(hand, fps=fps), distance)
    yield Case("decoys", "decoys, and a hidden tag", hidden=decoyed)
    for size, distance in ((30.0, 1.0), (30.0, 1.5), (40.0, 1.5)):
        yield Case("size", f"{size:g} mm, {distance:g} m", usual, distance, size)
    yield Case("size", "40 mm, 1.5 m, hand", hand, 1.5, 40.0)
    for distance in DISTANCES:
        yield Case("low", f"28° high, {distance:g} m", usual, distance, high_deg=28.0)
    for gait in GAITS[1:]:
        for distance in DISTANCES:
            yield Case("gaits", f"{gait}, {distance:g} m", usual, distance, gait=gait)
    for name, phone in worse.items():
        for distance in DISTANCES:
            yield Case("worse", f"{name}, {distance:g} m", phone, distance)
    for readout in (0.0, 0.025):
        yield Case("clock", f"readout {1e3 * readout:g} ms", replace(usual, readout_s=readout))
    for jitter in (0.003, 0.008):
        yield Case("clock", f"stamps vary by {1e3 * jitter:g} ms", replace(usual, jitter_s=jitter))


def decoyed(at: float, picture: Picture) -> Picture:
    """Hang patterns on the wall that are no tags of this robot, and pass something before one that is."""
    aruco = opencv().aruco
    families = (aruco.DICT_6X6_250, aruco.DICT_APRILTAG_36h10, aruco.DICT_APRILTAG_16h5, aruco.DICT_4X4_50)
    wall = [(aruco.DICT_APRILTAG_36h11, 7), *((family, 3) for family in families)]
    found = picture.copy()
    for index, (family, number) in enumerate(wall):
        tag = aruco.generateImageMarker(aruco.getPredefinedDictionary(family), number, 72)
        _lay(found, np.pad(tag, 9, constant_values=235), 40 + 130 * index, 60)
    squares = np.kron(np.indices((6, 6)).sum(axis=0) % 2, np.ones((16, 16))) * 200 + 20
    _lay(found, squares.astype(np.uint8), 800, 60)
    cells = np.kron(seeded(5).integers(0, 2, (8, 8)), np.ones((9, 9))) * 200 + 20
    _lay(found, np.pad(cells.astype(np.uint8), 9, constant_values=235), 950, 60)
    hand = seeded(6).integers(60, 200, (18, 18)).astype(np.uint8).repeat(10, axis=0).repeat(10, axis=1)
    _lay(found, hand, round(800 + 1500 * (at - BEGIN_S - 0.4)), 360)
    return found


def _lay(picture: Picture, patch: Picture, left: int, top: int) -> None:
    """Lay a patch on a picture, as far as it is inside."""
    low = max(left, 0)
    part = picture[top : top + len(patch), low : max(left + patch.shape[1], 0)]
    part[:] = patch[: len(part), low - left : low - left + part.shape[1]]


def stand(distance: float, high_deg: float = HIGH_DEG, along: float = 0.0) -> Stand:
    """A place in front of the robot, to its right, and above it, some metres along its way."""
    high, side = math.radians(high_deg), math.radians(15.0)
    level = distance * math.cos(high)
    x = 0.12 + along
    place = (x - level * math.sin(side), -0.04 - level * math.cos(side), 0.02 + distance * math.sin(high))
    return Stand(place, (x, -0.06, 0.02))


def tagged(size_mm: float) -> Problem:
    """ArcFold with tags of a size."""
    problem = load_problem("arcfold")
    tags = {n: tag.model_copy(update={"size_mm": size_mm}) for n, tag in problem.file.tags.items()}
    return replace(problem, file=problem.file.model_copy(update={"tags": tags}))


def places(stage: Stage, motion: Callable[[float], Array], made: Filmed, phone: Phone) -> dict[str, Array]:
    """Return where the middle of each tag is in each picture, and how far that moves meanwhile, (n, 3)."""
    model = mujoco.MjModel.from_xml_string(stage.mjcf)
    data = mujoco.MjData(model)
    lens = Lens(phone.size, phone.focal, phone.k1, phone.k2)
    half = 0.5 * (phone.exposure_s + phone.readout_s)
    found: dict[str, list[Array]] = {}
    for at, (turn, shift) in zip(made.times, made.cameras, strict=True):
        seen: dict[int, list[Array]] = {}
        for moment in (at - half, at, at + half):
            data.qpos[:] = motion(float(moment))
            mujoco.mj_kinematics(model, data)
            middles = {n: stage.axes @ data.site(site).xpos for n, (site, _) in stage.tags.items()}
            middles |= {n: np.array([*place, 0.0]) for n, (place, _, _) in stage.floor.items()}
            for n, middle in middles.items():
                seen.setdefault(n, []).append(lens.pixels(turn @ middle + shift))
        for n, (before, here, after) in seen.items():
            moved = float(np.linalg.norm(after - before))
            found.setdefault(f"tag {n}", []).append(np.array([*here, moved]))
    return {name: np.array(rows) for name, rows in found.items()}


def filmed(case: Case, problem: Problem, seconds: float, folder: Path) -> Walk:
    """The film of a case, made unless it is there already, and what it shows."""
    name = re.sub(r"[^a-z0-9.]+", "-", f"{case.study} {case.name}".lower())
    path, known = folder / f"{name}.mp4", folder / f"{name}.npz"
    if not known.exists():
        folder.mkdir(parents=True, exist_ok=True)
        stage, motion = stage_of(problem), walk(problem, case.gait, BEGIN_S + seconds + 0.5)
        place = stand(case.distance, case.high_deg)
        made = shot(path, stage, motion, place, case.phone, seconds, begin=BEGIN_S, hidden=case.hidden)
        true = truth(problem, stage, motion, made.times) | places(stage, motion, made, case.phone)
        np.savez(known, allow_pickle=False, times=made.times - made.times[0], **true)
    with np.load(known) as shown:
        content = {key: shown[key] for key in shown.files}
    return Walk(path, content.pop("times"), content)


def false_tags(found: FilmTrack, walked: Walk, shake_px: float) -> int:
    """Return how many tags were kept that are not where they were found."""
    count = 0
    for index, seen in enumerate(found.frames):
        for number, corners in seen.items():
            true = walked.truth.get(f"tag {number}")
            if true is None:
                count += 1
                continue
            away = float(np.linalg.norm(corners.mean(axis=0) - true[index, :2]))
            count += away > _FAR_PX + shake_px + true[index, 2]
    return count


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
    wrong = false_tags(found, walked, 5.0 * case.phone.shake_deg)
    table = []
    for name, series in found.signals.items():
        away = series - walked.truth[name]
        away -= np.nanmedian(away)
        scale = 1e3 if axis_of(name) in AXES else math.degrees(1.0)
        table.append(
            {
                "signal": name,
                "unit": "mm" if axis_of(name) in AXES else "deg",
                "error": f"{scale * float(np.nanstd(away)):.3f}",
                "stated": f"{scale * found.noise[name]:.3f}",
                "seen": f"{np.isfinite(series).mean():.3f}",
                "far_off": str(int((np.abs(away) > _SIGMAS * found.noise[name]).sum())),
                "false_tags": str(wrong),
                "stamps_ms": f"{late:.3f}",
                "focal_px": f"{found.room.lens.focal:.1f}",
                "readout_ms": f"{1e3 * found.readout_s:.2f}",
                "mbit_s": f"{8e-6 * walked.path.stat().st_size / seconds:.1f}",
            }
        )
    return table


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--films", type=Path, help="keep the films here, and take those that are there")
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--only", default=",".join(STUDIES), help="of these")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(options.out / "films.csv", ("study", "film", "gait"))
    with tempfile.TemporaryDirectory() as temporary:
        films = options.films or Path(temporary)
        for case in cases():
            if case.study in options.only.split(","):
                key = {"study": case.study, "film": case.name, "gait": case.gait}
                table.fill(key, partial(rows, case, options.seconds, films))


if __name__ == "__main__":
    main()
