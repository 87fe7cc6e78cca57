"""Sheets to print: tags to cut out, and the floor sheet; each length on them is exact."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline
from PIL.Image import Image

from gaitopt.core.errors import GaitoptError
from gaitopt.report.letters import drawable
from gaitopt.track.floor_sheet import SHEET_MM, SHEET_TAG_MM, START_LINE_MM
from gaitopt.track.tag import CELLS, MARGIN, pattern

PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
"""Width and height of the papers, mm."""

RULER_MM = 100.0
"""Length of the ruler on each sheet, mm."""

_EDGE = 12.0
"""What printers leave white at the edges of the paper, mm."""

_LABEL, _GAP, _HEAD, _FOOT = 4.0, 4.0, 27.0, 26.0
"""Height of a tag's name, distance between tags, height of a sheet's head and of its foot, mm."""

_GREY = "0.55"
_POINTS_PER_MM = 72.0 / 25.4


@dataclass(frozen=True)
class PrintedTag:
    """A tag to cut out.

    Attributes:
        number: its number.
        size_mm: edge of its black square, mm.
        name: what it is for, such as the site that it is glued to.
    """

    number: int
    size_mm: float
    name: str = ""

    @property
    def outer_mm(self) -> tuple[float, float]:
        """Width and height between the cutting lines, mm: with the white margin and its name below."""
        wide = self.size_mm * (1.0 + 2.0 * MARGIN)
        return wide, wide + _LABEL


def tag_sheets(tags: Sequence[PrintedTag], paper: str, places: Sequence[Image] = ()) -> list[Figure]:
    """Return the pages to print: the tags to cut out, where they go, and last the floor sheet.

    Args:
        tags: the tags, in order.
        paper: a key of `PAPERS_MM`.
        places: pictures of where they go.

    Raises:
        GaitoptError: a tag is larger than the paper, or OpenCV, which knows the patterns, is missing.
    """
    size = PAPERS_MM[paper]
    pages = list(_packed(tags, size))
    return [
        *(_cutting_page(placed, size, i + 1, len(pages)) for i, placed in enumerate(pages)),
        *(_places_page(places[i : i + 2], size) for i in range(0, len(places), 2)),
        _floor_page(size),
    ]


def write_sheets(path: Path, sheets: Iterable[Figure]) -> None:
    """Write pages as a PDF; the same pages give the same file."""
    with (
        matplotlib.rc_context({"pdf.fonttype": 42}),
        PdfPages(path, metadata={"CreationDate": None, "Title": "Tags for gaitopt"}) as file,
    ):
        for sheet in sheets:
            file.savefig(sheet)


_Placed = list[tuple[PrintedTag, float, float]]
"""Tags of a page with the lower left corner between the cutting lines, mm."""


def _packed(tags: Sequence[PrintedTag], paper: tuple[float, float]) -> Iterable[_Placed]:
    """Yield the tags of each page, in rows from the top."""
    width, height = paper
    page: _Placed = []
    left, top, row = _EDGE, height - _EDGE - _HEAD, 0.0
    for tag in tags:
        wide, high = tag.outer_mm
        if wide > width - 2 * _EDGE or high > height - 2 * _EDGE - _HEAD - _FOOT:
            raise GaitoptError(f"tag {tag.number}: found {tag.size_mm:g} mm; it is larger than the paper")
        if left + wide > width - _EDGE:
            left, top, row = _EDGE, top - row - _GAP, 0.0
        if top - high < _EDGE + _FOOT:
            yield page
            page, left, top, row = [], _EDGE, height - _EDGE - _HEAD, 0.0
        page.append((tag, left, top - high))
        left, row = left + wide + _GAP, max(row, high)
    if page:
        yield page


def _page(size: tuple[float, float]) -> tuple[Figure, Axes]:
    """Return a page whose axes are millimetres from its lower left corner."""
    figure = Figure(figsize=(size[0] / 25.4, size[1] / 25.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, size[0]), ylim=(0.0, size[1]))
    axes.set_axis_off()
    return figure, axes


def _cutting_page(placed: _Placed, size: tuple[float, float], number: int, count: int) -> Figure:
    figure, axes = _page(size)
    _text(axes, _EDGE, size[1] - _EDGE - 5.0, "Tags for gaitopt", 5.0)
    page = f"   ({number} of {count})" if count > 1 else ""
    for line, text in enumerate(
        (
            f"Print at 100 %, matt paper, black ink. AprilTag 36h11.{page}",
            "Cut along the dashed lines: the white margin is needed. Glue each tag flat.",
            "Its reading direction is x of its site, and z of the site points out of its face.",
        )
    ):
        _text(axes, _EDGE, size[1] - _EDGE - 11.0 - 4.5 * line, text, 3.0)
    for tag, left, bottom in placed:
        _cut_out(axes, tag, left, bottom)
    _ruler(axes, _EDGE, _EDGE + 8.0)
    return figure


def _places_page(places: Sequence[Image], size: tuple[float, float]) -> Figure:
    """Return a page with up to two pictures of where the tags go."""
    figure, axes = _page(size)
    top, wide = size[1] - _EDGE, size[0] - 2 * _EDGE
    _text(axes, _EDGE, top - 5.0, "Where the tags go", 5.0)
    _text(axes, _EDGE, top - 11.0, "Middle and turn of each tag as in the picture; number, site, edge.", 3.0)
    top -= 16.0
    for place in places:
        high = wide * place.height / place.width
        axes.imshow(np.asarray(place), extent=(_EDGE, _EDGE + wide, top - high, top), zorder=0.0)
        top -= high + _GAP
    axes.set(xlim=(0.0, size[0]), ylim=(0.0, size[1]), aspect="auto")
    return figure


def _cut_out(axes: Axes, tag: PrintedTag, left: float, bottom: float) -> None:
    wide, high = tag.outer_mm
    lines = (0, (3, 2))
    axes.add_patch(Rectangle((left, bottom), wide, high, fill=False, edgecolor=_GREY, lw=0.4, ls=lines))
    margin = MARGIN * tag.size_mm
    _black_cells(axes, tag.number, left + margin, bottom + _LABEL + margin, tag.size_mm)
    height = min(2.2, 0.11 * tag.size_mm)
    widest = wide / height * 1.3  # letters are about half as wide as high
    name = f"{tag.number}  {tag.name}" if tag.name else f"{tag.number}  {tag.size_mm:g} mm"
    _text(axes, left + margin, bottom + 0.35 * _LABEL, drawable(name, widest * 0.5), height)


def _floor_page(size: tuple[float, float]) -> Figure:
    """Return the floor sheet, on its side: the long edge lies along the direction of travel."""
    wide, high = max(size), min(size)
    figure, axes = _page((wide, high))
    x, y = 0.5 * wide, 0.5 * high
    margin = MARGIN * SHEET_TAG_MM
    for number, (along, left) in SHEET_MM.items():
        corner = x + along - 0.5 * SHEET_TAG_MM, y + left - 0.5 * SHEET_TAG_MM
        _black_cells(axes, number, *corner, SHEET_TAG_MM)
        _text(axes, corner[0], corner[1] - margin - 2.5, f"{number}", 2.2, color=_GREY)
    _text(
        axes,
        x - 122.0,
        y + 10.0,
        "Floor sheet: print at 100 %, lay it flat beside the robot's path, tape it down.",
        3.4,
    )
    axes.annotate(
        "",
        (x + 122.0, y),
        (x - 10.0, y),
        arrowprops={"arrowstyle": "-|>,head_width=0.5,head_length=0.9", "lw": 2.5, "color": "black"},
    )
    _text(axes, x - 60.0, y - 1.2, "direction of travel", 4.0)
    start = x + START_LINE_MM
    axes.plot([start, start], [_EDGE, high - _EDGE], color="black", lw=1.2)
    _text(axes, start + 1.2, y - 1.0, "start", 3.4)
    _ruler(axes, x - 50.0, y - 18.0)
    return figure


def _ruler(axes: Axes, left: float, bottom: float) -> None:
    """Draw a ruler of `RULER_MM`, and what it is for."""
    axes.plot([left, left + RULER_MM], [bottom, bottom], color="black", lw=0.6, solid_capstyle="butt")
    for mark in range(int(RULER_MM) + 1):
        height = 5.0 if mark % 10 == 0 else 3.5 if mark % 5 == 0 else 2.0
        axes.plot([left + mark] * 2, [bottom, bottom + height], color="black", lw=0.3, solid_capstyle="butt")
        if mark % 10 == 0:
            _text(axes, left + mark, bottom + 5.5, f"{mark}", 2.0, ha="center")
    rule = f"Measure this ruler. If it is not {RULER_MM:g} mm long, say what it is: gaitopt track --ruler-mm"
    _text(axes, left, bottom - 4.0, rule, 2.6)


def _black_cells(axes: Axes, number: int, left: float, bottom: float, size: float) -> None:
    """Draw a tag's black cells as one shape, so that no light shows between them."""
    cell = size / CELLS
    shapes = []
    for row, blacks in enumerate(pattern(number)):
        top = bottom + size - row * cell
        for begin, end in _runs(blacks):
            a, b = left + begin * cell, left + end * cell
            shapes.append(
                Outline([(a, top), (b, top), (b, top - cell), (a, top - cell), (a, top)], closed=True)
            )
    outline = Outline.make_compound_path(*shapes)
    axes.add_patch(PathPatch(outline, facecolor="black", lw=0.0, edgecolor="none", snap=False))


def _runs(flags: Iterable[bool]) -> list[tuple[int, int]]:
    """Return the first index and the index after the last of each run of set flags."""
    row = [False, *map(bool, flags), False]
    edges = [i for i in range(len(row) - 1) if row[i] != row[i + 1]]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _text(axes: Axes, x: float, y: float, text: str, height_mm: float, **look: Any) -> None:
    """Write a text whose capitals are about `height_mm` high."""
    axes.text(x, y, text, fontsize=height_mm * _POINTS_PER_MM / 0.73, family="DejaVu Sans", **look)
