"""Figures of gaits: how far the robot moves, what its servos do, and what its pads do on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gaitopt.gait.gait import Gait
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.report.figures.style import (
    BEST_COLOUR,
    COLOURS,
    STYLES,
    finish,
    legend_below,
    name_panel,
    name_rows,
    single_panel,
    stacked_panels,
    thinned,
)
from gaitopt.report.letters import drawable
from gaitopt.robot.roles import Roles
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import LOADED

_SLIDING_M_S = 5e-3
"""A loaded pad that moves slower than this along the ground counts as anchored."""

_SMOOTHING_S = 0.02
"""Load and speed of a pad are means over this long, as contacts chatter."""

_AT_LIMIT = 0.98
"""Share of the torque limit from which a servo counts as saturated."""

_MOST_CYCLES = 3
"""Cycles that the figure of the angles shows at most."""


def overlay(trajectories: Mapping[str, Trajectory], roles: Roles, best: str | None = None) -> Figure:
    """Draw the marker's forward position of several gaits, by name, in one panel.

    Args:
        trajectories: rollouts by name.
        roles: what is forward.
        best: the name of the gait to highlight.
    """
    figure, axes = single_panel(4.5)
    for index, (name, trajectory) in enumerate(trajectories.items()):
        chosen = name == best
        axes.plot(
            *thinned(trajectory.time, 1e3 * along(trajectory, roles, 0)),
            color=BEST_COLOUR if chosen else COLOURS[index % 5],
            linestyle="-" if chosen else STYLES[index % len(STYLES)],
            linewidth=2.2 if chosen else 1.5,
            label=drawable(name),
        )
    finish(axes, "time [s]", "marker forward [mm]")
    return figure


def panels(
    trajectories: Mapping[str, Trajectory], roles: Roles, axis: int = 0, best: str | None = None
) -> Figure:
    """Draw the marker's position along one axis, each gait in a panel of its own.

    Args:
        trajectories: rollouts by name.
        roles: what is forward, left and up.
        axis: forward (0), left (1) or up (2).
        best: the name of the gait to highlight.
    """
    figure, grid = stacked_panels(len(trajectories), 0.5 + 1.5 * len(trajectories))
    for axes, (name, trajectory) in zip(grid, trajectories.items(), strict=True):
        colour = BEST_COLOUR if name == best else COLOURS[0]
        axes.plot(*thinned(trajectory.time, 1e3 * along(trajectory, roles, axis)), color=colour)
        name_panel(axes, name)
        finish(axes, "", f"{('forward', 'left', 'up')[axis]} [mm]", legend=False)
    grid[-1].set_xlabel("time [s]")
    return figure


def gait_diagram(problem: Problem, gait: Gait, trajectory: Trajectory, robot: Robot) -> Figure:
    """Draw one cycle after the transient: what each servo does, and what each pad does on the ground."""
    chosen, cycle = _one_cycle(problem, gait, trajectory)
    names, pads = problem.channel_names, problem.roles.pads
    contacts = {pad: pad_states(problem, trajectory, pad, robot)[:, chosen] for pad in pads}
    rows = len(names) + bool(pads)
    figure, grid = stacked_panels(rows, 0.6 + 1.6 * rows)
    for axes, name in zip(grid, names, strict=False):
        _commanded_and_reached(axes, cycle, trajectory, name, chosen)
        for anchored, _, slipping in contacts.values():
            _shade(axes, cycle, anchored, "0.5", 0.15)
            _shade(axes, cycle, slipping, BEST_COLOUR, 0.25)
        name_panel(axes, name)
        finish(axes, "", "angle [°]", legend=name == names[0])
    if pads:
        _pad_bars(grid[-1], cycle, contacts)
        legend_below(figure, grid[-1], 3)
    grid[-1].set_xlabel("share of the cycle")
    grid[-1].set_xlim(0.0, 1.0)
    return figure


def angles(problem: Problem, gait: Gait, trajectory: Trajectory, robot: Robot) -> Figure:
    """Draw commanded and reached angles over the measured cycles, with each servo's limits."""
    transient, measured = problem.simulation.horizon.cycles(gait.period_s)
    begin = transient * gait.period_s
    end = begin + min(measured, _MOST_CYCLES) * gait.period_s
    chosen = (trajectory.time >= begin) & (trajectory.time <= end)
    time, names = trajectory.time[chosen], problem.channel_names
    figure, grid = stacked_panels(len(names), 0.8 + 1.8 * len(names))
    for axes, name, torque_limit in zip(grid, names, robot.torque_limit, strict=True):
        _commanded_and_reached(axes, time, trajectory, name, chosen)
        for limit in problem.file.channels[name].range_deg:
            axes.axhline(limit, color="k", linestyle=":", linewidth=1.0)
        axes.plot([], [], "k:", linewidth=1.0, label="range of the servo")
        torque = np.abs(trajectory[f"torque.{name}"][chosen])
        _shade(axes, time, torque >= _AT_LIMIT * torque_limit, COLOURS[1], 0.4)
        axes.fill_between([], [], color=COLOURS[1], alpha=0.4, label="at the torque limit")
        limited = f", torque limit {torque_limit:.3g} N m" if np.isfinite(torque_limit) else ""
        name_panel(axes, f"{name}{limited}")
        finish(axes, "", "angle [°]", legend=False)
    grid[-1].set_xlabel("time [s]")
    legend_below(figure, grid[0], 4)
    return figure


def commanded(gait: Gait) -> Figure:
    """Draw what a gait commands each servo over one cycle."""
    cycle = np.linspace(0.0, 1.0, 1001)
    figure, grid = stacked_panels(len(gait.channels), 0.6 + 1.3 * len(gait.channels))
    targets = np.rad2deg(gait.targets(cycle * gait.period_s))
    for axes, name, series in zip(grid, gait.channels, targets.T, strict=True):
        axes.plot(cycle, series, color=COLOURS[0])
        name_panel(axes, name)
        finish(axes, "", "angle [°]", legend=False)
    grid[-1].set_xlabel(f"share of the cycle of {gait.period_s:.3g} s")
    grid[-1].set_xlim(0.0, 1.0)
    return figure


def logged(commands: LoggedCommands) -> Figure:
    """Draw commands that are held row by row; a gap shows where a servo is unpowered."""
    ends = np.append(commands.time, commands.duration_s)
    figure, grid = stacked_panels(len(commands.channels), 0.6 + 1.3 * len(commands.channels))
    for axes, name, series in zip(grid, commands.channels, np.rad2deg(commands.rows).T, strict=True):
        axes.step(ends, np.append(series, series[-1]), where="post", color=COLOURS[0])
        name_panel(axes, name)
        finish(axes, "", "angle [°]", legend=False)
    grid[-1].set_xlabel("time [s]")
    grid[-1].set_xlim(0.0, commands.duration_s)
    return figure


def along(trajectory: Trajectory, roles: Roles, axis: int) -> NDArray[np.float64]:
    """Return how far the marker has moved from its start along forward, left or up, m, shape (n,)."""
    marker = trajectory.stacked("marker")
    moved: NDArray[np.float64] = (marker - marker[:1]) @ roles.axes[axis]
    return moved


def pad_states(problem: Problem, trajectory: Trajectory, pad: str, robot: Robot) -> NDArray[np.bool_]:
    """Return when a pad is anchored, when it slides forward and when it slips back, shape (3, n)."""
    forward, _, up = problem.roles.axes
    load = np.stack([trajectory[f"load.{pad}.{axis}"] for axis in "xyz"], axis=1) @ up
    speed = np.stack([trajectory[f"pad_speed.{pad}.{axis}"] for axis in "xyz"], axis=1) @ forward
    step = float(np.median(np.diff(trajectory.time))) if len(trajectory.time) > 1 else 1.0
    width = max(1, round(_SMOOTHING_S / step))
    load, speed = (_smoothed(series, width) for series in (np.abs(load), speed))
    loaded = load > LOADED * robot.weight
    return np.stack(
        [
            loaded & (np.abs(speed) <= _SLIDING_M_S),
            loaded & (speed > _SLIDING_M_S),
            loaded & (speed < -_SLIDING_M_S),
        ]
    )


# --- parts ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Bar:
    """The look of a bar that shows what a pad does."""

    label: str
    colour: str
    hatch: str | None = None
    edge: str | None = None


_PAD_BARS = (
    _Bar("anchored", "0.35"),
    _Bar("slides forward", COLOURS[4], "..", "white"),
    _Bar("slips back", BEST_COLOUR, "////", "white"),
)
"""In the order of `pad_states`."""


def _pad_bars(axes: Axes, cycle: NDArray[np.float64], contacts: Mapping[str, NDArray[np.bool_]]) -> None:
    """Draw a row of bars for each pad: solid where it holds, hatched where it slides."""
    for row, states in enumerate(contacts.values()):
        for state, bar in zip(states, _PAD_BARS, strict=True):
            axes.broken_barh(
                [(begin, end - begin) for begin, end in _spans(cycle, state)],
                (row - 0.35, 0.7),
                label=bar.label if row == 0 else None,
                facecolor=bar.colour,
                hatch=bar.hatch,
                edgecolor=bar.edge,
            )
    name_rows(axes, range(len(contacts)), list(contacts))
    axes.set_ylim(len(contacts) - 0.4, -0.6)
    name_panel(axes, "pads under load")
    finish(axes, "", "", legend=False)


def _commanded_and_reached(
    axes: Axes, x: NDArray[np.float64], trajectory: Trajectory, name: str, chosen: NDArray[np.bool_]
) -> None:
    target = np.rad2deg(trajectory[f"target.{name}"][chosen])
    reached = np.rad2deg(trajectory[f"position.{name}"][chosen])
    axes.plot(*thinned(x, target), "--", color="0.25", linewidth=1.4, label="commanded")
    axes.plot(*thinned(x, reached), color=COLOURS[0], linewidth=1.6, label="reached")


def _one_cycle(
    problem: Problem, gait: Gait, trajectory: Trajectory
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which samples lie in the first cycle after the transient, and where in the cycle they lie."""
    transient, _ = problem.simulation.horizon.cycles(gait.period_s)
    begin = transient * gait.period_s
    chosen = (trajectory.time >= begin) & (trajectory.time <= begin + gait.period_s)
    return chosen, (trajectory.time[chosen] - begin) / gait.period_s


def _shade(axes: Axes, x: NDArray[np.float64], where: NDArray[np.bool_], colour: str, alpha: float) -> None:
    for begin, end in _spans(x, where):
        axes.axvspan(begin, end, linewidth=0.0, zorder=0, color=colour, alpha=alpha)


def _spans(x: NDArray[np.float64], where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return the ends of the intervals of `x` in which `where` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    ends = np.append(x, x[-1:])
    return [(float(ends[a]), float(ends[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _smoothed(series: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    return np.convolve(series, np.full(width, 1.0 / width), mode="same")
