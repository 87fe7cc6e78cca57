"""The figure of the way from above: where each gait takes the robot, and how its trunk points there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gaitopt.report.figures.style import (
    BEST_COLOUR,
    COLOURS,
    STYLES,
    PlainFigure,
    finish,
    legend_below,
    thinned,
    width,
)
from gaitopt.report.letters import drawable
from gaitopt.robot.roles import Roles
from gaitopt.robot.rotation import rotation_matrices
from gaitopt.robot.trajectory import Trajectory

_ARROWS = 7
"""Headings that are shown along a way."""

_LOWEST, _HIGHEST = 2.4, 7.0
"""Inches of the figure: both axes have one scale."""

_BELOW = 0.9
"""Inches under the panel, for its label and the legend."""


@dataclass(frozen=True)
class Way:
    """Where a gait takes the robot.

    Attributes:
        name: the gait's name.
        nominal: the rollout on the nominal robot.
        draws: rollouts in scenarios, or on robots of a posterior.
        measured: the measured marker in the simulation's world, m, shape (n, 3); None without one.
    """

    name: str
    nominal: Trajectory
    draws: Sequence[Trajectory] = ()
    measured: NDArray[np.float64] | None = None


def from_above(ways: Sequence[Way], roles: Roles, best: str | None = None) -> Figure:
    """Draw ways of the marker over the ground, forward to the right and left upward, from one start.

    Args:
        ways: the ways, each with a marker; draws are thin lines of the same colour.
        roles: what is forward and left.
        best: the name of the gait to highlight.
    """
    lines = [over_ground(one, roles) for way in ways for one in (way.nominal, *way.draws)]
    lines += [_measured_line(way, roles) for way in ways if way.measured is not None]
    low, high = (
        np.min([line.min(axis=0) for line in lines], axis=0),
        np.max([line.max(axis=0) for line in lines], axis=0),
    )
    wide, tall = np.maximum(high - low, 1e-3)
    height = _BELOW + 0.2 * (len(ways) + 1) + float(np.clip(0.85 * width() * tall / wide, 0.8, 4.5))
    figure = PlainFigure(figsize=(width(), float(np.clip(height, _LOWEST, _HIGHEST))), layout="constrained")
    axes = figure.subplots()
    axes.axhline(0.0, color="0.6", linewidth=0.8, linestyle=":")
    for index, way in enumerate(ways):
        colour = BEST_COLOUR if way.name == best else COLOURS[index % 5]
        for one in way.draws:
            axes.plot(*thinned(*over_ground(one, roles).T), color=colour, linewidth=0.8, alpha=0.4)
        line = over_ground(way.nominal, roles)
        style = "-" if way.name == best else STYLES[index % len(STYLES)]
        said = _said(way.name, line[-1])
        axes.plot(*thinned(*line.T), color=colour, linestyle=style, linewidth=1.8, label=said)
        axes.plot(*line[-1], "o", color=colour, markersize=5.0)
        _headings(axes, way.nominal, roles, line, colour)
        if way.measured is not None:
            _measured(axes, way, roles)
    axes.plot(0.0, 0.0, "o", markerfacecolor="white", markeredgecolor="black", markersize=7.0, label="start")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06, 0.12)
    finish(axes, "forward [mm]", "left [mm]", legend=False)
    legend_below(figure, axes, 1)
    return figure


def over_ground(trajectory: Trajectory, roles: Roles) -> NDArray[np.float64]:
    """Return how far the marker has moved forward and left from its start, mm, shape (n, 2)."""
    marker = trajectory.stacked("marker")
    moved: NDArray[np.float64] = 1e3 * (marker - marker[:1]) @ roles.axes[:2].T
    return moved


def heading(trajectory: Trajectory, roles: Roles) -> NDArray[np.float64]:
    """Return where the trunk's forward direction points over the ground, shape (n, 2), not normalised."""
    turns = rotation_matrices(*(trajectory[f"heading.{part}"] for part in "wxyz"))
    pointing: NDArray[np.float64] = (turns @ roles.axes[0]) @ roles.axes[:2].T
    return pointing


def _headings(
    axes: Axes, trajectory: Trajectory, roles: Roles, line: NDArray[np.float64], colour: str
) -> None:
    """Draw arrows along a way, as the trunk points there."""
    rows = np.linspace(0, len(line) - 1, _ARROWS).astype(int)
    pointing = heading(trajectory, roles)[rows]
    pointing /= np.maximum(np.hypot(*pointing.T), 1e-12)[:, None]
    axes.quiver(
        *line[rows].T,
        *pointing.T,
        color=colour,
        angles="xy",
        scale=22.0,
        width=0.004,
        headwidth=4.0,
        zorder=3,
    )


def _measured_line(way: Way, roles: Roles) -> NDArray[np.float64]:
    """Return how far the measured marker has moved from the simulated one's start, mm, shape (n, 2)."""
    assert way.measured is not None
    line: NDArray[np.float64] = 1e3 * (way.measured - way.nominal.stacked("marker")[0]) @ roles.axes[:2].T
    return line


def _measured(axes: Axes, way: Way, roles: Roles) -> None:
    """Draw the measured marker of a way."""
    line = _measured_line(way, roles)
    axes.plot(*thinned(*line.T), "k:", linewidth=1.6, label=_said("measured", line[-1]))


def _said(name: str, end: NDArray[np.float64]) -> str:
    """Return what the legend says of a way: where it ends."""
    forward, left = (float(part) for part in end)
    side = "left" if left >= 0.0 else "right"
    return f"{drawable(name)}: {forward:.0f} mm forward, {abs(left):.0f} mm {side}"
