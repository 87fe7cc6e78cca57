"""The look of all figures: size, colours, line styles, grids, legends, ticks and names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import ceil
from textwrap import fill

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter
from numpy.typing import NDArray

from gaitopt.report.letters import drawable

COLOURS = ("#0072b2", "#946200", "#00775a", "#b0307c", "#6a51c7", "#c24a00", "#000000")
"""The hues of Okabe and Ito, which colour-blind readers can tell apart, dark enough for a contrast of 4.5 on
white. Styles and marks differ too, for print."""

STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-")
MARKS = ("o", "^", "s", "D", "v")

BEST_COLOUR = COLOURS[5]
"""Of the optimised gait, the corrected robot and what slips back."""

WIDTH = 6.0
"""Inches: the column of a printed page."""

NARROW = 3.9
"""Inches: the width of a phone, where ten-point type is as large as the page's."""

_LETTERS = 32
"""Letters of an axis' label in a line of a narrow figure."""

_LINE = 0.2
"""Inches of a line of a legend."""

_width = ContextVar("width", default=WIDTH)

_WIDEST_ROW = 2 / 3
"""Share of the width of a name beside a row, at most: it leaves some for what the row shows."""

_MOST_POINTS = 2500
"""Points of a line, about; a printer can show no more."""


class PlainFigure(Figure):
    """A figure that draws texts as they are: names with ``$`` are no formulas, and nothing is given to TeX.

    Ticks get their texts only when they are drawn, and other texts when they are made. So both are set.
    """

    def draw(self, renderer: RendererBase) -> None:
        """Draw the figure."""
        with rc_context({"text.parse_math": False, "text.usetex": False}):
            for text in self.findobj(Text):
                assert isinstance(text, Text)
                text.set_parse_math(False)
                text.set_usetex(False)
            super().draw(renderer)


@contextmanager
def narrow() -> Iterator[None]:
    """Draw figures that are as wide as a phone."""
    token = _width.set(NARROW)
    try:
        yield
    finally:
        _width.reset(token)


def width() -> float:
    """Return the width of the figures that are drawn now, inches."""
    return _width.get()


def stacked_panels(rows: int, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of a height in inches, and its panels from top to bottom, which share x."""
    figure = PlainFigure(figsize=(width(), height), layout="constrained")
    return figure, list(figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0])


def single_panel(height: float) -> tuple[Figure, Axes]:
    """Return a figure of a height in inches, and its one panel."""
    figure = PlainFigure(figsize=(width(), height), layout="constrained")
    return figure, figure.subplots()


def name_panel(axes: Axes, name: str) -> None:
    """Write a name above a panel."""
    axes.set_title(drawable(name), loc="left", fontsize=10)


def name_rows(axes: Axes, places: Sequence[float], names: Sequence[str], fontsize: float = 10.0) -> None:
    """Write names beside the rows of a panel."""
    widest = 72.0 * _WIDEST_ROW * width() / fontsize
    axes.set_yticks(places, [drawable(name, widest) for name in names], fontsize=fontsize)


def finish(axes: Axes, x: str, y: str, legend: bool = True) -> None:
    """Label the axes and give a panel the look of all figures."""
    axes.set_xlabel(x if width() == WIDTH else fill(x, _LETTERS))
    axes.set_ylabel(y)
    axes.grid(color="0.85", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if legend:
        axes.legend(fontsize=8.5, framealpha=0.9, loc="best")


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend under a figure, where it hides nothing; a narrow figure grows with it."""
    handles, labels = axes.get_legend_handles_labels()
    fits = columns if width() == WIDTH else min(columns, 2)
    more = ceil(len(labels) / fits) - ceil(len(labels) / columns)
    figure.set_figheight(figure.get_figheight() + _LINE * more)
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=fits,
        fontsize=8.5 if width() == WIDTH else 9.0,
        frameon=False,
    )


def plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers, the small ticks too where it spans few decades."""
    axis.set_major_formatter(_PlainLog())
    axis.set_minor_formatter(_PlainLog(minor_thresholds=(2, 0.5)))


class _PlainLog(LogFormatter):
    """Labels where Matplotlib's own formatter has some, without powers."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


def thinned(
    x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a line with no more points than a printer can show."""
    every = max(1, len(x) // _MOST_POINTS)
    return x[::every], y[::every]
