"""The page of tracked films: what was found, gaps, noise, and what to do better."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from gaitopt.core.json import to_json
from gaitopt.core.quantities import figure, unit_of
from gaitopt.diagnose.record.defect import Defect
from gaitopt.report.figures import tracking as plots
from gaitopt.report.film.overlay import first_picture, write_overlay
from gaitopt.report.page import Page, Picture, Section, Table, after_results, image_section, save_figures
from gaitopt.robot.signals import is_position
from gaitopt.runs.folder import PAGE_FILE, filled_folder, write_into
from gaitopt.track.advice import advice, point_advice
from gaitopt.track.found import FilmTrack
from gaitopt.track.tracking import Tracker
from gaitopt.track.untagged import PointTrack


def write_tracking(
    path: Path | None,
    name: str,
    films: Sequence[FilmTrack | PointTrack],
    defects: Sequence[Defect],
    tracker: Tracker | None,
) -> Path:
    """Write the page, figures and overlays of tracked films, and return their folder.

    Args:
        path: a new or empty folder.
        name: the problem's name.
        films: what was found in each film.
        defects: what is wrong with them.
        tracker: what was looked for; None where there are no tags.
    """
    with filled_folder(path, f"{name}-track") as folder:
        write_into(folder, "track.json", to_json({"films": [film.to_dict() for film in films]}))
        for film in films:
            write_into(folder, f"overlays/{film.film.stem}.mp4", partial(_overlay, film))
        with after_results(folder, "track.json"):
            write_into(folder, PAGE_FILE, _page(folder, name, films, defects, tracker).html())
    return folder


def _overlay(film: FilmTrack | PointTrack, path: Path) -> None:
    write_overlay(path, film)


def _page(
    folder: Path,
    name: str,
    films: Sequence[FilmTrack | PointTrack],
    defects: Sequence[Defect],
    tracker: Tracker | None,
) -> Page:
    sections = [section for film in films for section in _sections(folder, film, tracker)]
    return Page(
        title=f"{name}: tracked films",
        answer=" ".join(f"{film.sentence()}." for film in films),
        asked={"Films": ", ".join(str(film.film) for film in films)},
        notes=[f"{defect.trial}: {defect.name}: {defect.message}" for defect in defects],
        sections=sections,
    )


def _sections(folder: Path, film: FilmTrack | PointTrack, tracker: Tracker | None) -> list[Section]:
    """Return what the page says of a film."""
    stem = film.film.stem
    if isinstance(film, PointTrack) or tracker is None:
        what = "the point that was followed (orange) and its path"
        better, tables = point_advice(film), []
    else:
        what = "the tags of the robot (orange) and of the floor (blue); a white line is a tag's upper edge"
        better, tables = advice(film, tracker), [Section(f"{stem}: tags", table=_tags(film))]
    buffer = io.BytesIO()
    first_picture(film).save(buffer, format="PNG")
    drawn = {
        f"{stem}-tracks": Picture(
            f"{stem}: tracks",
            partial(plots.tracks, film),
            "Each signal about its mean. Shaded: gaps, where nothing was seen, or was left out.",
        )
    }
    caption = f"The first picture with {what}. The whole film: overlays/{stem}.mp4; {film.sync.sentence()}."
    return [
        image_section(f"{stem}: what was found", buffer.getvalue(), "png", caption),
        Section(f"{stem}: next time", sentences=better or ["Nothing to do better."]),
        *tables,
        Section(f"{stem}: signals", table=_signals(film)),
        *save_figures(folder, drawn),
    ]


def _tags(film: FilmTrack) -> Table:
    rows = [
        [f"{n}", "floor" if n in film.room.floor else "robot", f"{share:.0%}", _edge(film, n)]
        for n, share in film.shares.items()
    ]
    return Table(head=["tag", "on", "seen", "width [px]"], rows=rows, words=(1,))


def _edge(film: FilmTrack, number: int) -> str:
    return f"{film.edges_px[number]:.0f}" if number in film.edges_px else "–"


def _signals(film: FilmTrack | PointTrack) -> Table:
    rows = []
    for name, series in film.signals.items():
        unit, factor = unit_of("_m" if is_position(name) else "_rad")
        seen = float((series == series).mean())
        rows.append([name, f"{figure(factor * film.noise[name])} {unit}", f"{seen:.0%}"])
    return Table(
        head=["signal", "noise", "measured"],
        rows=rows,
        note="Noise: standard deviation, from how well the tags' corners fit. Measured: share of frames.",
        words=(0,),
    )
