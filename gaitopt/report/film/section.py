"""A film or a player on a page: its section, or a note that says why there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.text import one_line
from gaitopt.report import settings as defaults
from gaitopt.report.film.encode import first_picture
from gaitopt.report.page import Section, data_uri, rendered
from gaitopt.report.settings import ReportSettings
from gaitopt.runs.folder import write_into


@dataclass(frozen=True)
class FilmPart:
    """What a film adds to a page."""

    sections: tuple[Section, ...] = ()
    notes: tuple[str, ...] = ()


def film_part(folder: Path, name: str, title: str, caption: str, write: Callable[[Path], object]) -> FilmPart:
    """Write a film into ``figures/``, and return what it adds to a page.

    Args:
        folder: the folder of the page.
        name: name of the film's file, without suffix.
        title: title of its section.
        caption: what to see in it.
        write: simulates what is filmed, and writes an MP4 to a path. If it fails, the page has a note instead
            of a film.
    """
    try:
        path = write_into(folder, f"figures/{name}.mp4", write)
        poster, fps = first_picture(path)
    except Exception as error:
        return FilmPart(notes=(f"No film: {one_line(error)}",))
    body = rendered(
        "film.html",
        title=title,
        caption=caption,
        film=data_uri(path.read_bytes(), "video/mp4"),
        poster=data_uri(poster, "image/webp"),
        fps=fps,
    )
    return FilmPart(sections=(Section(title, body=body, styles=["player.css"], scripts=["film.js"]),))


def film_on_page_s(block_s: float, settings: ReportSettings | None = None) -> float:
    """Return the length of a film on a page, s.

    Args:
        block_s: length of a gait's cycle, or of a block of commands without cycles, s.
        settings: about how long the film is.
    """
    settings = settings or defaults.DEFAULT
    return block_s * max(1, round(settings.film_s / block_s))
