"""An overlay: a film with the tags that were found in it drawn into its pictures."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from PIL import Image, ImageDraw

from gaitopt.problem.tags import SHEET_TAGS
from gaitopt.report.film.encode import write_mp4
from gaitopt.report.letters import font
from gaitopt.track.film import pictures
from gaitopt.track.found import FilmTrack
from gaitopt.track.untagged import PointTrack

_WIDEST = 960
"""Width of the overlay, at most, pixels."""

_ROBOT, _FLOOR, _WORDS = (213, 94, 0), (0, 114, 178), (255, 255, 255)


def write_overlay(path: Path, found: FilmTrack | PointTrack) -> None:
    """Write an overlay as MP4.

    Args:
        path: where to.
        found: what was found in the film, which is read again.

    Raises:
        GaitoptError: the film cannot be read any more.
    """
    write_mp4(path, _drawn(found), max(1.0, found.fps))


def first_picture(found: FilmTrack | PointTrack) -> Image.Image:
    """Return the first picture of an overlay."""
    return next(_drawn(found))


def _drawn(found: FilmTrack | PointTrack) -> Iterator[Image.Image]:
    for index, (at, picture) in enumerate(pictures(found.film, colour=True)):
        if index == len(found.time):
            return
        image = Image.fromarray(picture)
        scale = min(1.0, _WIDEST / max(image.size))
        image = image.resize((round(scale * image.width), round(scale * image.height)), Image.Resampling.BOX)
        draw = ImageDraw.Draw(image)
        if isinstance(found, PointTrack):
            missing = _point(draw, found, index, scale)
        else:
            missing = _tags(draw, found, index, scale)
        words = f"{at:.3f} s, picture {index}{missing}"
        draw.text((8, 8), words, _WORDS, font(16), stroke_width=2, stroke_fill=(0, 0, 0))
        yield image


def _tags(draw: ImageDraw.ImageDraw, found: FilmTrack, index: int, scale: float) -> str:
    """Draw the tags of a picture, and say which are not seen."""
    seen = found.frames[index]
    for number, corners in seen.items():
        colour = _FLOOR if number in SHEET_TAGS or number in found.room.floor else _ROBOT
        points = [(float(x), float(y)) for x, y in scale * corners]
        draw.line([*points, points[0]], fill=colour, width=2)
        draw.line(points[:2], fill=_WORDS, width=2)  # its upper edge
        draw.text((max(x for x, _ in points) + 3, min(y for _, y in points)), f"{number}", colour, font(14))
    missing = [n for n in found.shares if n not in seen and n not in found.room.floor]
    return f"   not seen: {', '.join(map(str, missing))}" if missing else ""


def _point(draw: ImageDraw.ImageDraw, found: PointTrack, index: int, scale: float) -> str:
    """Draw the point of a picture and its path until then, and say whether it is not seen."""
    path = scale * found.places[: index + 1]
    for before, after in pairwise(path):
        if (before == before).all() and (after == after).all():
            draw.line([tuple(map(float, before)), tuple(map(float, after))], fill=_ROBOT, width=1)
    if not (path[-1] == path[-1]).all():
        return "   not seen"
    x, y = map(float, path[-1])
    draw.ellipse((x - 6, y - 6, x + 6, y + 6), outline=_ROBOT, width=2)
    return ""
