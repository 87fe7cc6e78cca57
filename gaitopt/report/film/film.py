"""Films of robots that move: their length, their pictures and their files, without a screen."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_with
from gaitopt.core.progress import Count, OnProgress, silent
from gaitopt.gait.drive import Drive
from gaitopt.report import settings as defaults
from gaitopt.report.film.encode import write_loop, write_mp4
from gaitopt.report.film.scene import Scene
from gaitopt.report.film.take import Take
from gaitopt.report.settings import FilmSettings

FORMATS = (".mp4", ".gif", ".webp")


def film_length(shown: Sequence[Take] | Sequence[Drive], settings: FilmSettings | None = None) -> float:
    """Return the default length of a film, s: whole cycles of the slowest gait."""
    settings = settings or defaults.DEFAULT.film
    period = max(one.block_s for one in shown)
    return period * math.ceil(settings.min_s / period * (1.0 - 1e-12))


def loop_rate(takes: Sequence[Take], settings: FilmSettings | None = None) -> float:
    """Return the pictures per second of a GIF or WebP: as few as show a cycle of the fastest gait."""
    settings = settings or defaults.DEFAULT.film
    wanted = settings.pictures_per_cycle / min(shown.block_s for shown in takes)
    return next((rate for rate in settings.loop_rates if rate >= wanted), settings.loop_rates[-1])


def check_film(path: Path) -> None:
    """Check that a film can be written under this name, before anything is computed for it.

    Raises:
        GaitoptError: its suffix is none of `FORMATS`, or its folder does not exist.
    """
    if path.suffix.lower() not in FORMATS:
        raise GaitoptError(f"{path}: no film format; allowed: a file that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise GaitoptError(f"{path}: cannot be written: no folder {path.parent}")


def write_film(
    path: Path,
    takes: Sequence[Take],
    begin: float = 0.0,
    end: float | None = None,
    settings: FilmSettings | None = None,
    on_progress: OnProgress = silent,
) -> None:
    """Write a film of one robot, or of several side by side, in the format that the suffix says.

    Args:
        path: where to; ``.mp4`` (H.264), ``.gif`` or ``.webp`` (these two repeat without end).
        takes: who is shown, from left to right, all on the same clock.
        begin, end: gait times, s; `film_length` by default.
        settings: how it looks.
        on_progress: called after each picture.

    Raises:
        GaitoptError: the format is unknown, there is no OpenGL, or the file cannot be written.
    """
    check_film(path)
    settings = settings or defaults.DEFAULT.film
    if path.suffix.lower() == ".mp4":
        size, fps, write = settings.size, settings.fps, write_mp4
    else:
        size, fps, write = settings.loop_size, loop_rate(takes, settings), write_loop
    end = film_length(takes, settings) if end is None else end
    times = begin + np.arange(max(1, round((end - begin) * fps))) / fps
    count = Count(on_progress, defaults.FILM, len(times), "pictures")
    with closing(frames(takes, times, size, settings)) as pictures:
        write_with(path, lambda temporary: write(temporary, _counted(pictures, count), fps))


def _counted(pictures: Iterable[Image.Image], count: Count) -> Generator[Image.Image]:
    for picture in pictures:
        yield picture
        count.one()


def frames(
    takes: Sequence[Take],
    times: NDArray[np.float64],
    size: tuple[int, int] | None = None,
    settings: FilmSettings | None = None,
) -> Generator[Image.Image]:
    """Yield the pictures of a film.

    Args:
        takes: who is shown, from left to right.
        times: gait times, s, shape (n,).
        size: width and height of each robot's picture, pixels; that of an MP4 by default.
        settings: how it looks.

    Raises:
        GaitoptError: there is no OpenGL.
    """
    settings = settings or defaults.DEFAULT.film
    width, height = size = size or settings.size
    with ExitStack() as stack:
        scenes = [stack.enter_context(closing(Scene(shown, size, times, settings))) for shown in takes]
        for at in times:
            whole = Image.new("RGB", (width * len(takes), height))
            for index, scene in enumerate(scenes):
                whole.paste(scene.picture(float(at)), (width * index, 0))
            yield whole
