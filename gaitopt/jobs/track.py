"""The job `track`: films of a tagged robot to a data set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.folders import check_new_or_empty
from gaitopt.core.progress import OnProgress, silent
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import VIEWS, ImportOptions, Motion
from gaitopt.diagnose.record.importing import Imported, Recording, write_recordings
from gaitopt.gait.gait import Gait
from gaitopt.jobs.inputs import check_positive
from gaitopt.problem.problem import Problem
from gaitopt.problem.tags import SHEET_TAGS, TAG_SIZES_MM, Tag, check_tag_number
from gaitopt.track.follow import Dot, Patch
from gaitopt.track.found import FilmTrack
from gaitopt.track.readout import LONGEST_S
from gaitopt.track.sync import Beginning, FrameMark, LampMark, TagMark, TimeMark
from gaitopt.track.tracking import Tracker, track_film
from gaitopt.track.untagged import Length, PointTrack, PointTracker, track_point

T = TypeVar("T")

_COMMANDS_S, _NEW_RAD = 1e-3, 1e-3
"""Times at which commands are compared with those before the gait, s, and what counts as a new one, rad."""

_LEAST_LENGTH_PX = 20.0
"""Least extent of a known length in the picture, pixels."""

_RULER_MM, _RULER = 100.0, (80.0, 125.0)
"""Length of the printed ruler, and what printers make of it, mm."""


@dataclass(frozen=True)
class TrackOptions:
    """What films and the problem do not say.

    Attributes:
        tags: site of further tags by number; None for one on the floor.
        size_mm: edge of these tags, mm; 20 by default.
        ruler_mm: length of the printed ruler of 100 mm, mm.
        sync: what shows that the gait begins in each film: one for all, or one each; none where nothing does.
        readout_ms: how much later the phone reads the last row of its pictures than the first, ms; by default
            as a moving camera or a moving robot shows it.
        points: for films without tags a point and a known length: one for all, or one each.
    """

    tags: Mapping[str, str | None] = field(default_factory=dict)
    size_mm: float | None = None
    ruler_mm: float = _RULER_MM
    sync: Sequence[Beginning] = ()
    readout_ms: float | None = None
    points: Sequence[PointTracker] = ()


def marks(
    times_s: Sequence[float] = (),
    frames: Sequence[int] = (),
    lamps: Sequence[Sequence[float]] = (),
    tags: Sequence[int] = (),
) -> list[Beginning]:
    """Return what shows that gaits begin: times, numbers of pictures, pixels of lamps, numbers of tags."""
    return [
        *map(TimeMark, times_s),
        *map(FrameMark, frames),
        *(LampMark(x, y) for x, y in lamps),
        *map(TagMark, tags),
    ]


def points(
    places: Sequence[Sequence[float]], lengths: Sequence[Sequence[float]], view: str = "side"
) -> list[PointTracker]:
    """Return what is followed in films without tags.

    Args:
        places: a dot, x and y, or a patch, x, y, width and height, in the first picture, pixels.
        lengths: two points, x and y each, in the direction of travel, pixels, and their distance, mm.
        view: ``side`` or ``top``.

    Raises:
        GaitoptError: there are not as many of each, or one of one.
    """
    if not places and not lengths:
        return []
    if not places or not lengths or (len(places) != len(lengths) and min(len(places), len(lengths)) > 1):
        raise GaitoptError(
            f"found {len(places)} of --dot and --patch, and {len(lengths)} of --length; allowed: both, one "
            "of each or as many as films"
        )
    count = max(len(places), len(lengths))
    return [
        PointTracker(Dot(*place) if len(place) == 2 else Patch(*place), Length((x, y), (u, v), mm), view)
        for place, (x, y, u, v, mm) in zip(_each(places, count), _each(lengths, count), strict=True)
    ]


@dataclass(frozen=True)
class TrackRun:
    """A data set of films.

    Attributes:
        folder: the data set.
        films: what was found in each film.
        recordings: the trials, as they were written.
    """

    folder: Path
    films: tuple[FilmTrack | PointTrack, ...]
    recordings: tuple[Imported, ...]

    @property
    def defects(self) -> list[Defect]:
        """Everything that is wrong with the films."""
        return [defect for recording in self.recordings for defect in recording.defects]

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt track --json` prints."""
        pairs = zip(self.recordings, self.films, strict=True)
        trials = [{"name": recording.name, **film.to_dict()} for recording, film in pairs]
        rows = [defect.to_dict() for defect in self.defects]
        return {"dataset": str(self.folder), "trials": trials, "defects": rows}


def track(
    films: Sequence[Path | str],
    problem: Problem,
    gaits: Sequence[str] | str,
    out: Path | str,
    options: TrackOptions | None = None,
    on_progress: OnProgress = silent,
    report: Path | str | None = None,
) -> TrackRun:
    """Write a data set of films of a tagged robot; nothing is written unless all can be tracked.

    Args:
        films: the films, each a trial; those of one gait are its repeats.
        problem: the robot; its ``[tags]`` say where the tags sit.
        gaits: what was commanded: one name or gait file for all films, or one for each.
        out: the new data set.
        options: what films and the problem do not say.
        on_progress: called after some pictures.
        report: a new or an empty folder for a page, with the tags drawn into the films; none by default.

    Raises:
        GaitoptError: a folder holds something, an option is out of range, or a film cannot be tracked.
    """
    options = options or TrackOptions()
    folder, paths = Path(out), [Path(film) for film in films]
    check_new_or_empty(folder)
    page = None if report is None else Path(report)
    check_new_or_empty(page)
    if page is not None and page.absolute() == folder.absolute():
        raise GaitoptError(f"--report: found {page}; allowed: another folder than the data set's")
    gaits = [gaits] if isinstance(gaits, str) else list(gaits)
    _check(options, paths, gaits, problem)
    begins = _each(options.sync or (None,), len(paths))
    tracks: list[FilmTrack | PointTrack]
    tracker: Tracker | None = None
    if options.points:
        followed = zip(paths, _each(options.points, len(paths)), begins, strict=True)
        tracks = [track_point(path, point, on_progress, begin) for path, point, begin in followed]
        starts = [found.sync.at_s for found in tracks]
    else:
        tracker = Tracker.of(problem, _all_tags(problem, options), options.ruler_mm / _RULER_MM)
        readout_s = None if options.readout_ms is None else 1e-3 * options.readout_ms
        tagged = [
            track_film(path, tracker, on_progress, begin, readout_s)
            for path, begin in zip(paths, begins, strict=True)
        ]
        played = [problem.find_gait(gait) for gait in _each(gaits, len(paths))]
        starts = [_began(*one, tracker) for one in zip(tagged, begins, played, strict=True)]
        tracks = [*tagged]
    read = [
        Recording(found.film, "film", _motion(found, at)) for found, at in zip(tracks, starts, strict=True)
    ]
    recordings = write_recordings(read, gaits, folder, ImportOptions(), problem)
    done = TrackRun(folder, tuple(tracks), tuple(recordings))
    if page is not None:
        from gaitopt.report.tracking import write_tracking

        write_tracking(page, problem.name, tracks, done.defects, tracker)
    return done


def _each(given: Sequence[T], count: int) -> list[T]:
    """Return one for each film; one is for all of them."""
    return list(given) * (count if len(given) == 1 else 1)


def _began(found: FilmTrack, begin: Beginning | None, gait: Gait, tracker: Tracker) -> float | None:
    """Return the time stamp of the gait's time 0, s. A tag of the robot moves at its first new command."""
    at = found.sync.at_s
    if at is None or not isinstance(begin, TagMark) or begin.tag not in tracker.robot.numbers():
        return at
    times = np.arange(0.0, gait.period_s, _COMMANDS_S)
    away = np.abs(gait.targets(times) - tracker.robot.model.key_ctrl[0]).max(axis=1)
    return at - float(times[np.argmax(away > _NEW_RAD)])


def _motion(found: FilmTrack | PointTrack, sync_at_s: float | None) -> Motion:
    defects = list(found.defects)
    return Motion(found.time, found.signals, defects, found.film.stem, sync_at_s=sync_at_s, fps=found.fps)


def _check(options: TrackOptions, films: Sequence[Path], gaits: Sequence[str], problem: Problem) -> None:
    """Check what can be checked before the films are read."""
    check_positive("size-mm", options.size_mm)
    low, high = _RULER
    if not low <= options.ruler_mm <= high:
        allowed = f"{low:g} to {high:g}: what the printed ruler of {_RULER_MM:g} mm measures"
        raise bad_value("gaitopt track", "--ruler-mm", options.ruler_mm, allowed)
    _check_each("--gait", gaits, len(films))
    if options.sync:
        _check_each("--sync", options.sync, len(films))
    for mark in options.sync:
        if isinstance(mark, TimeMark) and not (math.isfinite(mark.at_s) and abs(mark.at_s) < 1e5):
            raise bad_value("gaitopt track", "--sync-at", mark.at_s, "seconds from the film's first picture")
        if isinstance(mark, TagMark) and mark.tag in SHEET_TAGS:
            raise bad_value("gaitopt track", "--sync-tag", mark.tag, "a tag that is not on the floor sheet")
    longest = 1e3 * LONGEST_S
    if options.readout_ms is not None and not abs(options.readout_ms) <= longest:
        raise bad_value("gaitopt track", "--readout-ms", options.readout_ms, f"-{longest:g} to {longest:g}")
    if options.points:
        _check_points(options, len(films), problem)
    names = [film.stem for film in films]
    if len(set(names)) < len(names):
        raise GaitoptError(f"two films have the same name: {', '.join(sorted(names))}; rename one")
    for gait in gaits:
        problem.find_gait(gait)


def _check_each(option: str, given: Sequence[object], films: int) -> None:
    """Check that an option is given once for all films, or once for each."""
    if len(given) not in (1, films):
        raise GaitoptError(f"{option}: found {len(given)} for {films} films; allowed: one, or one each")


def _check_points(options: TrackOptions, films: int, problem: Problem) -> None:
    """Check what is followed in films without tags."""
    _check_each("--dot or --patch", options.points, films)
    if problem.roles.marker is None:
        raise GaitoptError(f"{problem.source}: has no marker, whose motion a point without tags is")
    if options.tags or options.readout_ms is not None:
        raise GaitoptError(
            "--dot or --patch: found with --tag or --readout-ms, which are for films with tags"
        )
    if any(isinstance(mark, TagMark) for mark in options.sync):
        raise GaitoptError("--sync-tag: found in a film without tags; allowed: --sync-led, -frame or -at")
    for point in options.points:
        length, view = point.length, point.view
        if view not in VIEWS:
            raise bad_value("gaitopt track", "--view", view, ", ".join(VIEWS), VIEWS)
        away = math.dist(length.begin, length.end)
        if not (math.isfinite(length.mm) and length.mm > 0.0 and _LEAST_LENGTH_PX <= away < math.inf):
            found = f"{length.mm:g} mm over {away:.0f} pixels"
            raise bad_value(
                "gaitopt track", "--length", found, f"more than 0 mm over {_LEAST_LENGTH_PX:g} or more"
            )


def _all_tags(problem: Problem, options: TrackOptions) -> dict[int, Tag]:
    """Return the tags of the problem, and those of the options, by number.

    Raises:
        GaitoptError: a number or size is out of range, or two tags are on one site.
    """
    tags = {int(number): tag for number, tag in problem.file.tags.items()}
    low, high = TAG_SIZES_MM
    if options.size_mm is not None and not low <= options.size_mm <= high:
        raise bad_value("gaitopt track", "--size-mm", options.size_mm, f"{low:g} to {high:g}")
    size = {} if options.size_mm is None else {"size_mm": options.size_mm}
    for text, site in options.tags.items():
        try:
            number = check_tag_number("--tag", text)
        except ValueError as error:
            raise GaitoptError(str(error)) from None
        known = {} if number not in tags else {"size_mm": tags[number].size_mm}
        tags[number] = Tag(site=site, **(known | size))
    sites = [tag.site for tag in tags.values() if tag.site is not None]
    twice = next((site for site in sites if sites.count(site) > 1), None)
    if twice is not None:
        raise GaitoptError(f"--tag: found the site {twice!r} twice; allowed: one tag on each site")
    return tags
