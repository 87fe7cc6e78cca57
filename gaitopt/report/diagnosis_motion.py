"""The parts of a diagnosis' page that show the robot itself, beside the measured marker if there is one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gaitopt.core.text import one_line
from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.predict import latest_gait_time
from gaitopt.diagnose.record.trial import Trial
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.problem.problem import Problem
from gaitopt.report.figures.way import Way
from gaitopt.report.film.section import FilmPart, film_on_page_s, film_part
from gaitopt.report.film.take import Take, take_beside
from gaitopt.report.motion import player_part, shown_takes, way_picture
from gaitopt.report.page import Picture, Section
from gaitopt.robot.signals import MARKER
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class MotionParts:
    """What shows the robot itself on the page of a diagnosis.

    Attributes:
        sections: a player, and a film if one was requested.
        pictures: the way from above, where a marker has one.
        notes: why one of them is missing.
    """

    sections: tuple[Section, ...] = ()
    pictures: tuple[tuple[str, Picture], ...] = ()
    notes: tuple[str, ...] = ()


def motion_parts(
    folder: Path, problem: Problem, diagnosis: Diagnosis, correction: Correction | None, full: bool
) -> MotionParts:
    """Return what shows the trial with the largest gap: the nominal and the corrected robot.

    Args:
        folder: the folder of the page.
        problem: the nominal problem.
        diagnosis: the diagnosis.
        correction: the corrected robot; None where nothing was fitted.
        full: add a film, which takes longer.
    """
    gap = max(diagnosis.trials, key=lambda one: (_has_marker(one), _worst(one)))
    trial, filmed = gap.aligned.trial, _has_marker(gap)
    robots = {"nominal": problem} | ({"corrected": correction.problem} if correction else {})
    length = film_on_page_s(trial.drive.block_s)
    try:
        takes = [
            shown.named(f"{trial.drive.name}, {name}")
            for name, robot in robots.items()
            for shown in _takes(Simulator.build(robot), trial, length, filmed)
        ]
    except Exception as error:
        return MotionParts(notes=(f"No robot in 3-D: {one_line(error)}",))
    caption = f"Trial {trial.name}: the robot as simulated, {' and '.join(robots)}" + (
        ", beside the measured marker. Both markers start at the same point. Their distance is the gap."
        if filmed
        else "."
    )
    player = player_part("The robot", caption, takes)
    film = _film(folder, takes, caption, length) if full and filmed and takes else FilmPart()
    pictures = way_picture(_ways(takes, gap), problem, gaits=False) if problem.roles.marker else {}
    return MotionParts(
        (*player.sections, *film.sections), tuple(pictures.items()), (*player.notes, *film.notes)
    )


def _takes(simulator: Simulator, trial: Trial, length: float, filmed: bool) -> list[Take]:
    """Return a robot under the drive of a trial, with the measured marker if there is one."""
    if filmed:
        return [take_beside(simulator, trial, length)]
    name, duration = trial.drive.name, max(length, latest_gait_time(trial))
    trajectory = simulator.run(trial.drive, duration=duration, poses=True)
    return shown_takes(simulator, {name: trial.drive}, {name: trajectory})


def _film(folder: Path, takes: Sequence[Take], caption: str, length: float) -> FilmPart:
    """Film the robots with the measured marker."""
    from gaitopt.report.film.film import write_film

    begin = max(0.0, *(float(shown.ghost.time[0]) for shown in takes if shown.ghost))

    def write(path: Path) -> None:
        write_film(path, takes, begin, begin + length)

    return film_part(folder, "film", "Measured beside simulated, filmed", caption, write)


def _ways(takes: Sequence[Take], gap: TrialGap) -> list[Way]:
    """Return the ways of the robots, the first with the measured one if that was measured on the ground."""
    ways: list[Way] = []
    for shown in takes:
        across = {name for name, part in zip(MARKER, np.abs(shown.axes[:2]).max(axis=0), strict=True) if part}
        known = shown.ghost is not None and across <= set(gap.floors) and not ways
        measured = shown.ghost.positions if shown.ghost and known else None
        walked = shown.trajectory
        if shown.ghost is not None:
            walked = _until(walked, float(shown.ghost.time[-1]))
        ways.append(Way(shown.name, walked, measured=measured))
    return ways


def _until(trajectory: Trajectory, end: float) -> Trajectory:
    """Return the samples up to a gait time, s, for as long as the recording lasts."""
    rows = slice(max(1, int(np.searchsorted(trajectory.time, end, side="right"))))
    signals = {name: series[rows] for name, series in trajectory.signals.items()}
    return Trajectory(trajectory.time[rows], signals, trajectory.status)


def _has_marker(gap: TrialGap) -> bool:
    return bool(set(MARKER) & set(gap.floors))


def _worst(gap: TrialGap) -> float:
    """Return the largest ratio of a gap to its floor, of the marker where there is one."""
    ratios = gap.ratios
    found = ratios.get("marker", max(ratios.values(), default=0.0))
    return found if math.isfinite(found) else 0.0
