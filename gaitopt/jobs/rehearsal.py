"""The job `rehearse`: a synthetic phone films a tagged robot, to plan where to put the camera."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import write_with
from gaitopt.core.progress import OnProgress, silent
from gaitopt.core.quantities import figure, unit_of
from gaitopt.jobs.inputs import check_positive, checked_seed
from gaitopt.jobs.outputs import writing
from gaitopt.problem.problem import Problem
from gaitopt.problem.tags import TAG_SIZES_MM
from gaitopt.robot.signals import is_position
from gaitopt.track.advice import advice
from gaitopt.track.found import FilmTrack
from gaitopt.track.tracking import Tracker, track_film

if TYPE_CHECKING:
    from gaitopt.report.film.stage import Stage, Stand

Array = NDArray[np.float64]

_REST_S, _LONGEST_S = 0.5, 30.0
"""Rest before the gait, and the longest film, s."""

_SHEET_HALF_M = 0.115
"""From the robot's side to the middle of a floor sheet beside it, m."""

_HAND_M, _HAND_DEG = 0.002, 0.4
"""Standard deviation of a hand's motion."""


@dataclass(frozen=True)
class Camera:
    """Where a phone is.

    Attributes:
        distance_m: from the middle of the tags, m.
        height_deg: above the floor, as the tags see it, degrees.
        back_deg: how far it stands back from straight beside the robot, degrees.
    """

    distance_m: float
    height_deg: float
    back_deg: float


@dataclass(frozen=True)
class RehearsalOptions:
    """How a film is made.

    Attributes:
        camera: where the phone is.
        fps: frames a second.
        seconds: length, s; half a second of rest and a cycle by default.
        hand: whether the phone is held in the hand.
        size_mm: edge of the robot's tags, mm; those of the problem by default.
        seed: seed of noise and shake.
    """

    camera: Camera
    fps: float = 30.0
    seconds: float | None = None
    hand: bool = False
    size_mm: float | None = None
    seed: int = 1


@dataclass(frozen=True)
class Rehearsal:
    """A synthetic film, and how well it is tracked.

    Attributes:
        film: the film.
        found: what was found in it.
        errors: RMS error of each signal about its mean, m or rad.
        better: what to do better, in sentences.
    """

    film: Path
    found: FilmTrack
    errors: Mapping[str, float]
    better: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return what was found, in lines."""
        signals = []
        for name, error in self.errors.items():
            unit, factor = unit_of("_m" if is_position(name) else "_rad")
            stated = f"{figure(factor * self.found.noise[name])} {unit} stated"
            seen = float(np.isfinite(self.found.signals[name]).mean())
            signals.append(
                f"{name}: error {figure(factor * error)} {unit}, {stated}, in {seen:.0%} of frames"
            )
        tags = [line for line in self.found.lines() if line.startswith("tag ")]
        return [*tags, *signals, *self.better]

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt film --json` prints."""
        content = self.found.to_dict()
        rows = [
            {"signal": name, ("error_m" if is_position(name) else "error_rad"): error}
            for name, error in self.errors.items()
        ]
        return content | {"errors": rows, "better": list(self.better)}


def rehearse(
    problem: Problem,
    gait: str,
    out: Path | str,
    options: RehearsalOptions,
    on_progress: OnProgress = silent,
) -> Rehearsal:
    """Film a tagged robot with a synthetic phone, and track the film.

    The phone has a lens, a rolling shutter, motion blur, noise and H.264. The floor sheet lies beside the
    robot, on the phone's side.

    Args:
        problem: the robot; its ``[tags]`` say where the tags sit.
        gait: a baseline, a gait file, an exported table or a run folder.
        out: the film, a file that ends in ``.mp4``.
        options: how the film is made.
        on_progress: called after some pictures.

    Raises:
        GaitoptError: an option is out of range, there is no OpenGL, or the film cannot be tracked: then it is
            there, and can be looked at.
    """
    from gaitopt.report.film.phone import Phone, shot
    from gaitopt.report.film.stage import stage_of, truth, walk

    path = Path(out)
    _check(options, path)
    if options.size_mm is not None:
        tags = {
            n: tag.model_copy(update={"size_mm": options.size_mm}) for n, tag in problem.file.tags.items()
        }
        problem = replace(problem, file=problem.file.model_copy(update={"tags": tags}))
    with writing(problem, path):
        tracker = Tracker.of(problem, {int(n): tag for n, tag in problem.file.tags.items()})
        seconds = options.seconds or min(_REST_S + problem.find_gait(gait).period_s, _LONGEST_S)
        motion = walk(problem, gait, seconds)
        stand, sheet = _placed(problem, stage_of(problem), motion, seconds - _REST_S, options.camera)
        stage = stage_of(problem, sheet)
        phone = Phone(fps=options.fps, exposures=5 if options.hand else 9)
        if options.hand:
            phone = replace(phone, shake_m=_HAND_M, shake_deg=_HAND_DEG)
        times: list[Array] = []

        def film(temporary: Path) -> None:
            made = shot(
                temporary, stage, motion, stand, phone, seconds, -_REST_S, options.seed, progress=on_progress
            )
            times.append(made.times)

        write_with(path, film)
    found = track_film(path, tracker, on_progress)
    true = truth(problem, stage, motion, times[0])
    errors = {name: float(np.nanstd(series - true[name])) for name, series in found.signals.items()}
    return Rehearsal(path, found, errors, tuple(advice(found, tracker)))


def _check(options: RehearsalOptions, path: Path) -> None:
    """Check what can be checked before a film is made."""
    if path.suffix.lower() != ".mp4":
        raise GaitoptError(f"{path}: no film that can be made; allowed: a file that ends in .mp4")
    checked_seed(options.seed)
    check_positive("seconds", options.seconds)
    low, high = TAG_SIZES_MM
    camera = options.camera
    for name, value, least, most in (
        ("--fps", options.fps, 10.0, 240.0),
        ("--seconds", options.seconds, _REST_S + 0.1, _LONGEST_S),
        ("--size-mm", options.size_mm, low, high),
        ("--camera", camera.distance_m, 0.1, 10.0),
        ("--camera", camera.height_deg, 0.0, 89.0),
        ("--camera", camera.back_deg, -80.0, 80.0),
    ):
        if value is not None and not least <= value <= most:
            raise bad_value("gaitopt film", name, value, f"{least:g} to {most:g}")


def _placed(
    problem: Problem, stage: Stage, motion: Callable[[float], Array], end: float, camera: Camera
) -> tuple[Stand, tuple[float, float]]:
    """Return where the phone is, and where the middle of the floor sheet lies."""
    from gaitopt.report.film.stage import Stand, robot_corners

    model = mujoco.MjModel.from_xml_string(stage.mjcf)
    data = mujoco.MjData(model)
    tags, corners = [], []
    faces = np.zeros(3)
    for at in np.linspace(0.0, max(end, 0.0), 9):
        data.qpos[:] = motion(float(at))
        mujoco.mj_kinematics(model, data)
        tags += [stage.axes @ data.site(site).xpos for site, _ in stage.tags.values()]
        corners.append(robot_corners(data) @ stage.axes.T)
        faces += sum(stage.axes @ data.site(site).xmat.reshape(3, 3)[:, 2] for site, _ in stage.tags.values())
    side = 1.0 if faces[1] > 0.0 else -1.0
    target = np.mean(tags, axis=0)
    back, high = math.radians(camera.back_deg), math.radians(camera.height_deg)
    level = np.array([-math.sin(back), side * math.cos(back), 0.0])
    place = target + camera.distance_m * (math.cos(high) * level + math.sin(high) * np.array([0.0, 0.0, 1.0]))
    edge = float((side * np.concatenate(corners)[:, 1]).max())
    sheet = side * (edge + _SHEET_HALF_M)
    x, y, z = (float(v) for v in place)
    u, v, _ = (float(v) for v in target)
    return Stand((x, y, z), (u, 0.5 * (v + sheet), 0.0)), (u, sheet)
