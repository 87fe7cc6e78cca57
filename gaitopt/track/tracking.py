"""Tracking: a film of a tagged robot becomes signals, their noise, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.threads import on_one_thread
from gaitopt.diagnose.record.defect import Defect, counted, spans_of
from gaitopt.problem.problem import Problem
from gaitopt.problem.tags import Tag
from gaitopt.robot.signals import AXES, MARKER, TURNS, joint_signal
from gaitopt.track import path as paths
from gaitopt.track.bodies import Link, TaggedRobot
from gaitopt.track.film import facts_of, pictures
from gaitopt.track.floor_sheet import SHEET_MM, SHEET_TAG_MM
from gaitopt.track.found import FilmTrack
from gaitopt.track.pose import Pose
from gaitopt.track.room import FloorTag, Room, Seen, solved_room
from gaitopt.track.seeing import Eye, edge_of
from gaitopt.track.settings import DEFAULT, TrackSettings
from gaitopt.track.shutter import said_readout, unrolled
from gaitopt.track.sync import (
    UNKNOWN,
    Beginning,
    FrameMark,
    Lamp,
    LampMark,
    Sync,
    TagMark,
    TimeMark,
    first_motion,
)

Array = NDArray[np.float64]

_FEWEST = 10
"""Fewest pictures of a film."""

_REACH = 8.0
"""Standard deviations within which a joint has to move the bodies alike."""

_SAME = 0.03
"""A tag on the floor may be this much larger or smaller than it should be, relative."""

_HEIGHT_M, _SIZE = 0.015, 0.06
"""A tag may be seen this much higher or lower than at the start, m, and look so much larger, relative."""

_SAME_M = 0.01
"""Two tags may be this much nearer or farther from each other than their sites allow, m."""


@dataclass(frozen=True)
class Tracker:
    """What is looked for in films.

    Attributes:
        robot: the robot with its tags.
        floor: the tags of the floor by number.
        settings: how films are judged.
    """

    robot: TaggedRobot
    floor: Mapping[int, FloorTag]
    settings: TrackSettings = DEFAULT

    @staticmethod
    def of(
        problem: Problem, tags: Mapping[int, Tag], scale: float = 1.0, settings: TrackSettings = DEFAULT
    ) -> Tracker:
        """Return what is looked for in films of a robot.

        Args:
            problem: the robot's problem.
            tags: all tags but those of the floor sheet, by number.
            scale: what the printer made of 1 mm, mm.
            settings: how films are judged.

        Raises:
            GaitoptError: no tag sits on the robot, a site is unknown, or the model is broken.
        """
        mm = 1e-3 * scale
        sheet = {
            number: FloorTag(mm * SHEET_TAG_MM, np.array([mm * along, mm * left, 0.0]), fixed=True)
            for number, (along, left) in SHEET_MM.items()
        }
        loose = {n: FloorTag(mm * tag.size_mm) for n, tag in tags.items() if tag.site is None}
        on_robot = {n: tag for n, tag in tags.items() if tag.site is not None}
        return Tracker(TaggedRobot.of(problem, on_robot, scale), sheet | loose, settings)


@on_one_thread
def track_film(
    film: Path,
    tracker: Tracker,
    progress: OnProgress = silent,
    beginning: Beginning | None = None,
    readout_s: float | None = None,
) -> FilmTrack:
    """Return what is found in a film.

    Args:
        film: the film.
        tracker: what is looked for.
        progress: called after some pictures.
        beginning: what shows that the gait begins, if it is known.
        readout_s: how much later the phone reads the last row of its pictures than the first, s; by default
            as a moving camera or a moving robot shows it.

    Raises:
        GaitoptError: it is no film, ends in the middle, or shows no tag of the robot or of the floor; or a
            tag on the floor is not as large as was said.
    """
    robot, settings = tracker.robot, tracker.settings
    shown = [beginning.tag] if isinstance(beginning, TagMark) else []
    eye = Eye([*robot.numbers(), *tracker.floor, *shown], tracker.floor, settings)
    lamp = Lamp(beginning, tracker.floor) if isinstance(beginning, LampMark) else None
    time, frames, size, quarters = _seen(film, eye, lamp, progress)
    missing = _check_seen(film, robot, frames, eye)
    try:
        room = solved_room(frames, tracker.floor, size, settings)
        _check_sizes(room)
        said = None if readout_s is None else said_readout(readout_s, quarters)
        view = unrolled(time, frames, room, tracker.floor, robot, settings, said, quarters)
    except GaitoptError as error:
        raise GaitoptError(f"{film}: {error}") from None
    room, cameras = view.room, view.cameras
    pairs = zip(robot.bodies, view.paths, strict=True)
    found = {body.site: path for body, path in pairs if path.seen.any()}
    signals, noise = _signals(robot, found)
    numbers = [*robot.numbers(), *room.floor]
    edges = _edges(frames, numbers)
    joints, joint_noise, defects = _joints(film, robot, found, edges, settings)
    defects += _wrong_sizes(film, robot, found, cameras)
    sync = _beginning(beginning, lamp, time, frames, cameras, room)
    everything = [*missing, *_strangers(film, eye), *_outliers(film, found, time), *defects]
    if sync.at_s is None and beginning is not None:
        everything.append(Defect("sync_not_found", film.stem, sync.how, 0))
    return FilmTrack(
        film,
        time,
        signals | joints,
        noise | joint_noise,
        paths.shares(frames, numbers),
        room,
        {site: path.error_px for site, path in found.items()},
        tuple(everything),
        frames,
        edges,
        view.readout.main,
        sync,
    )


def _beginning(
    beginning: Beginning | None,
    lamp: Lamp | None,
    time: Array,
    frames: Sequence[Seen],
    cameras: Sequence[Pose | None],
    room: Room,
) -> Sync:
    """Return when the gait began."""
    if isinstance(beginning, TagMark):
        return first_motion(beginning.tag, time, frames, cameras, room)
    if isinstance(beginning, (TimeMark, FrameMark)):
        return beginning.sync(time)
    return UNKNOWN if lamp is None else lamp.sync(time)


def _seen(
    film: Path, eye: Eye, lamp: Lamp | None, progress: OnProgress
) -> tuple[Array, list[Seen], tuple[int, int], int]:
    """Return time stamps, corners of the tags in each picture, and the pictures' size and quarter turns."""
    facts = facts_of(film)
    total = facts.frames
    times: list[float] = []
    frames: list[Seen] = []
    size = (0, 0)
    for at, picture in pictures(film):
        if times and at <= times[-1]:
            raise GaitoptError(
                f"{film}: time goes backward after {times[-1]:.3f} s; allowed: a film as it was made"
            )
        times.append(at)
        frames.append(eye.look(picture))
        if lamp is not None:
            lamp.look(picture, frames[-1])
        size = (picture.shape[1], picture.shape[0])
        progress(Progress(film.name, len(times), max(total, len(times)) or None, "frames"))
    if len(times) < _FEWEST:
        raise GaitoptError(f"{film}: found {counted(len(times), 'picture')}; allowed: {_FEWEST} or more")
    return np.array(times), frames, size, facts.quarters


def _check_seen(film: Path, robot: TaggedRobot, frames: Sequence[Seen], eye: Eye) -> list[Defect]:
    """Check that a tag of the robot is seen; return a defect for each that is not."""
    shares = paths.shares(frames, robot.numbers())
    listed = ", ".join(map(str, shares))
    if not any(shares.values()):
        others = ", ".join(map(str, sorted(eye.strangers)))
        seen = f"; seen: {others}, which sit nowhere" if others else ""
        raise GaitoptError(f"{film}: no tag of the robot is seen; looked for {listed}{seen}")
    return [
        Defect("tag_not_seen", film.stem, f"tag {n} is in no picture", 0)
        for n, share in shares.items()
        if not share
    ]


def _check_sizes(room: Room) -> None:
    """Check that the tags of the floor are as large as was said."""
    for number, ratio in room.sizes.items():
        if abs(ratio - 1.0) > _SAME:
            said = 1e3 * room.floor[number].size
            raise GaitoptError(
                f"tag {number}: found {ratio * said:.1f} mm on the floor, by the other tags, where "
                f"{said:g} mm was said; print at 100 %, or say size_mm in [tags.{number}], or --ruler-mm"
            )


def _wrong_sizes(
    film: Path, robot: TaggedRobot, found: Mapping[str, paths.Path], cameras: Sequence[Pose | None]
) -> list[Defect]:
    """Return bodies whose tags are probably not as large as was said: they are seen at a wrong height.

    A tag that is smaller than was said looks farther away, so it is seen lower than the robot can have it.
    """
    defects = []
    for body in robot.bodies:
        poses = found[body.site].poses if body.site in found else ()
        seen = [(p, c) for p, c in zip(poses, cameras, strict=False) if p is not None and c is not None]
        if not seen:
            continue
        heights = np.array([pose.shift[2] for pose, _ in seen])
        nearest = np.argsort(np.abs(heights - body.height))[: max(1, len(heights) // 10)]
        height = float(np.median(heights[nearest]))
        above = float(np.median([-(camera.turn.T @ camera.shift)[2] for _, camera in seen]))
        ratio = (above - body.height) / (above - height) if above > height else 1.0
        if abs(height - body.height) < _HEIGHT_M or abs(ratio - 1.0) < _SIZE:
            continue
        numbers = ", ".join(map(str, body.tags))
        said = 1e3 * float(np.mean([np.linalg.norm(c[1] - c[0]) for c in body.tags.values()]))
        message = (
            f"{body.site}: seen {1e3 * abs(height - body.height):.0f} mm too "
            f"{'high' if height > body.height else 'low'}; if it stands on the floor, tag {numbers} "
            f"is {ratio * said:.0f} mm wide, not {said:.0f}: measure it, and say size_mm"
        )
        defects.append(Defect("tag_size_doubtful", film.stem, message, 0))
    return defects


def _strangers(film: Path, eye: Eye) -> list[Defect]:
    if not eye.strangers:
        return []
    listed = ", ".join(map(str, sorted(eye.strangers)))
    return [Defect("unknown_tags", film.stem, f"tags {listed} are seen, but sit nowhere: left out", 0)]


def _outliers(film: Path, found: Mapping[str, paths.Path], time: Array) -> list[Defect]:
    defects = []
    for site, path in found.items():
        if path.left_out:
            flags = np.zeros(len(time), dtype=bool)
            flags[list(path.left_out)] = True
            message = (
                f"{site}: {counted(len(path.left_out), 'picture')} with a pose that does not fit its tags"
            )
            share = {"share": float(flags.mean())}
            defects.append(
                Defect(
                    "tag_outliers",
                    film.stem,
                    f"{message}: left out",
                    len(path.left_out),
                    spans_of(time, flags),
                    parameters=share,
                )
            )
    return defects


def _signals(
    robot: TaggedRobot, found: Mapping[str, paths.Path]
) -> tuple[dict[str, Array], dict[str, float]]:
    """Return the signals of marker and sites, and their noise.

    A body that has the marker gives the marker's place; any other that of its site. Both give angles.
    """
    signals: dict[str, Array] = {}
    noise: dict[str, float] = {}
    for body in robot.bodies:
        path = found.get(body.site)
        if path is None:
            continue
        named = [f"site.{body.site}.{axis}" for axis in AXES] if body.marker is None else list(MARKER)
        own = np.zeros(3) if body.marker is None else body.marker
        angles = [f"site.{body.site}.{turn}" for turn in TURNS]
        for names, (series, variances) in ((named, path.point(own)), (angles, path.angles())):
            for index, name in enumerate(names):
                signals[name] = series[:, index]
                noise[name] = float(np.sqrt(np.nanmean(variances[:, index])))
    if robot.problem.roles.marker is not None:
        return _in_order(signals), noise
    return signals, noise


def _in_order(signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return signals with the marker first."""
    return {n: signals[n] for n in sorted(signals, key=lambda name: name not in MARKER)}


def _joints(
    film: Path,
    robot: TaggedRobot,
    found: Mapping[str, paths.Path],
    edges: Mapping[int, float],
    settings: TrackSettings,
) -> tuple[dict[str, Array], dict[str, float], list[Defect]]:
    """Return the angles of the joints between tagged bodies, their noise, and bodies that do not fit."""
    signals: dict[str, Array] = {}
    noise: dict[str, float] = {}
    defects = []
    for link in robot.links():
        names = [joint_signal(name) if name else "" for name in link.names()]
        one, other = (found.get(body.site) for body in (link.one, link.other))
        if one is None or other is None or all(name in signals for name in names):
            continue
        edge = min(edges[n] for body in (link.one, link.other) for n in body.tags if n in edges)
        series, variances, away = _angles(link, one, other, edge, settings)
        if not np.isfinite(away).any():
            continue
        if np.nanmedian(away) > _SAME_M:
            message = (
                f"the tags of {link.one.site} and {link.other.site} are {1e3 * np.nanmedian(away):.0f} mm "
                "from where any angle of a joint puts them: are they at their sites, and of the size said?"
            )
            defects.append(Defect("tags_misplaced", film.stem, message, 0))
        for index, name in enumerate(names):
            if name and name not in signals and np.isfinite(series[:, index]).any():
                signals[name] = series[:, index]
                noise[name] = float(np.sqrt(np.nanmean(variances[:, index])))
    return signals, noise, defects


def _angles(
    link: Link, one: paths.Path, other: paths.Path, edge: float, settings: TrackSettings
) -> tuple[Array, Array, Array]:
    """Return angles and variances, rad, shape (n, joints), and what they leave unexplained, m, shape (n,)."""
    count = len(one.poses)
    series, variances = (np.full((count, len(link.joints)), np.nan) for _ in range(2))
    away = np.full(count, np.nan)
    last: Array | None = None
    noise = 0.5 * (one.noise + other.noise)
    scale = settings.least_px / edge / np.sqrt(noise)
    for index, (a, b) in enumerate(zip(one.poses, other.poses, strict=True)):
        solved = None if a is None or b is None else link.angles(a, b, last, scale)
        last = None
        if solved is None:
            continue
        away[index], spread = solved.away, noise * solved.variances
        if solved.error > settings.outlier**2 * noise * (6 - len(spread)):
            continue  # one of the two poses is wrong
        if solved.doubt < settings.outlier**2 * noise:
            continue  # other angles explain the poses as well
        known = spread < settings.joint_rad**2
        if known.any():
            known &= link.straight(solved.values, _REACH * np.sqrt(spread))
        series[index, known], variances[index, known] = solved.values[known], spread[known]
        last = solved.values if known.all() else None
    return series, variances, away


def _edges(frames: Sequence[Seen], numbers: Sequence[int]) -> dict[int, float]:
    """Return the median edge of each tag in the pictures, pixels."""
    edges = {n: [edge_of(frame[n]) for frame in frames if n in frame] for n in numbers}
    return {n: float(np.median(e)) for n, e in edges.items() if e}
