"""Figures of gaits side by side: their speeds, and their differences scenario by scenario."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gaitopt.optimise.compare import ComparedGait
from gaitopt.report.figures.style import BEST_COLOUR, COLOURS, finish, legend_below, name_rows, single_panel
from gaitopt.report.letters import WIDEST_IN_LEGEND, drawable
from gaitopt.runs.summary import GaitRow


def speeds(rows: Sequence[GaitRow | ComparedGait], best: str | None = None) -> Figure:
    """Draw mean forward speed with its 90 % interval and the worst scenario: one bar for each row.

    Args:
        rows: the gaits.
        best: the name of the gait to highlight.
    """
    figure, axes = single_panel(1.0 + 0.45 * len(rows))
    places = np.arange(len(rows))[::-1]
    mean = np.array([1e3 * row.speed_m_s for row in rows])
    ends = np.array([[1e3 * end for end in row.speed_ci90_m_s] for row in rows])
    colours = [BEST_COLOUR if row.name == best else COLOURS[0] for row in rows]
    axes.barh(places, mean, color=colours, height=0.6)
    errors = np.abs(ends - mean[:, None]).T
    axes.errorbar(mean, places, xerr=errors, fmt="none", ecolor="k", capsize=4, label="90 % interval")
    worst = np.array([1e3 * row.speed_worst_m_s for row in rows])
    axes.plot(worst, places, "kx", markersize=6, label="worst scenario")
    _write_beside(axes, np.nanmax([ends[:, 1], worst, np.zeros(len(rows))], axis=0), places, mean)
    name_rows(axes, places.tolist(), [row.name for row in rows])
    axes.axvline(0.0, color="k", linewidth=0.8)
    finish(axes, "forward speed [mm/s]", "", legend=False)
    legend_below(figure, axes, 2)
    return figure


def differences(rows: Sequence[ComparedGait]) -> Figure:
    """Draw how much faster each gait after the first is than the first, scenario by scenario."""
    others = rows[1:]
    figure, axes = single_panel(1.3 + 0.5 * len(others))
    places = np.arange(len(others))[::-1]
    first = np.array(rows[0].scenario_speeds_m_s)
    for place, row in zip(places.tolist(), others, strict=True):
        apart = 1e3 * (np.array(row.scenario_speeds_m_s) - first)
        spread = place + 0.16 * np.linspace(-1.0, 1.0, len(apart))
        label = "a scenario" if row is others[0] else None
        axes.plot(apart, spread, "o", color=COLOURS[0], markersize=3.5, alpha=0.8, label=label)
    mean = np.array([1e3 * row.difference_m_s for row in others])
    ends = np.array([[1e3 * end for end in row.difference_ci90_m_s] for row in others])
    axes.errorbar(
        mean, places, xerr=np.abs(ends - mean[:, None]).T, fmt="kD", markersize=5, capsize=5,
        label="mean, 90 % interval",
    )  # fmt: skip
    name_rows(axes, places.tolist(), [row.name for row in others])
    axes.set_ylim(-0.6, len(others) - 0.4)
    axes.axvline(0.0, color="k", linewidth=0.8, linestyle="--")
    name = drawable(rows[0].name, WIDEST_IN_LEGEND)
    finish(axes, f"forward speed minus that of {name} [mm/s]", "", legend=False)
    legend_below(figure, axes, 2)
    return figure


def _write_beside(
    axes: Axes, ends: NDArray[np.float64], places: NDArray[np.intp], values: NDArray[np.float64]
) -> None:
    """Write the values beside bars that end there."""
    for end, place, value in zip(ends, places, values, strict=True):
        if np.isfinite(value):
            axes.annotate(
                f"{value:.1f}",
                (end, place),
                xytext=(7, 0),
                textcoords="offset points",
                va="center",
                fontsize=9,
            )
    axes.margins(x=0.12)
