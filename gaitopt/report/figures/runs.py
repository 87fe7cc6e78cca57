"""Figures of several searches of one robot: their best gaits side by side, and what mattered in each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gaitopt.report.figures.style import (
    COLOURS,
    MARKS,
    STYLES,
    finish,
    legend_below,
    name_rows,
    single_panel,
)
from gaitopt.report.letters import WIDEST_IN_LEGEND, drawable

_ROW = 0.26
"""Inches of a row."""


def best_gaits(names: Sequence[str], points: Mapping[str, NDArray[np.float64]]) -> Figure:
    """Draw the best gaits of searches over parallel axes, one a row.

    Args:
        names: the coordinates.
        points: the best gait of each search, as a point of the unit box, shape (d,).
    """
    figure, axes = single_panel(1.6 + _ROW * len(names))
    rows = np.arange(len(names))
    for index, (run, point) in enumerate(points.items()):
        axes.plot(
            point,
            rows,
            color=COLOURS[index % len(COLOURS)],
            linestyle=STYLES[index % len(STYLES)],
            marker=MARKS[index % len(MARKS)],
            markersize=4,
            label=drawable(run, WIDEST_IN_LEGEND),
        )
    axes.set_xlim(-0.03, 1.03)
    axes.invert_yaxis()
    name_rows(axes, rows.tolist(), names)
    finish(axes, "from the smallest to the largest value allowed", "", legend=False)
    legend_below(figure, axes, 2)
    return figure


def importance(names: Sequence[str], shares: Mapping[str, NDArray[np.float64]]) -> Figure:
    """Draw how much of the ranking of the gaits each coordinate explains by itself.

    Args:
        names: the coordinates.
        shares: the shares of each search, shape (d,).
    """
    figure, axes = single_panel(1.6 + _ROW * len(names))
    rows = np.arange(len(names))
    for index, (run, values) in enumerate(shares.items()):
        axes.plot(
            100.0 * values,
            rows,
            linestyle="",
            color=COLOURS[index % len(COLOURS)],
            marker=MARKS[index % len(MARKS)],
            markersize=5,
            label=drawable(run, WIDEST_IN_LEGEND),
        )
    axes.set_xlim(left=-1.0)
    axes.invert_yaxis()
    name_rows(axes, rows.tolist(), names)
    finish(axes, "share of the ranking [%]", "", legend=False)
    legend_below(figure, axes, 2)
    return figure
