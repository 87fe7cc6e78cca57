"""Figures: each a function from records to a Matplotlib figure, with units and a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, MaxNLocator
from numpy.typing import NDArray

from gaitopt.core.quantities import title_of
from gaitopt.gait.gait import Gait
from gaitopt.optimise.compare import ComparedGait
from gaitopt.optimise.journal import WORKING, Entry, at_rung
from gaitopt.optimise.pareto import FrontGait, speed, transport
from gaitopt.optimise.sensitivity import Sensitivity
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.roles import Roles
from gaitopt.robot.trajectory import Trajectory
from gaitopt.runs.summary import GaitRow
from gaitopt.simulation.metrics import LOADED

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#000000")
"""Okabe and Ito's palette, which colour-blind readers can tell apart; styles differ too, for print."""

STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-")
BEST_COLOUR = "#d55e00"

_WIDTH = 6.0
"""Inches: the column of a printed page; on a phone, a page across, ten-point type is still legible."""

_MARKS = ("o", "^", "s", "D", "v")
_SLIDING_M_S = 5e-3
"""A loaded pad that moves slower than this along the ground counts as anchored."""

_AT_LIMIT = 0.98
"""Share of the torque limit from which a servo counts as saturated."""

_POINTS = 2500
"""A line has no more points than a printer can show."""


def overlay(trajectories: Mapping[str, Trajectory], roles: Roles, best: str | None = None) -> Figure:
    """Draw the marker's forward position of several gaits in one picture."""
    figure = Figure(figsize=(_WIDTH, 4.5), layout="constrained")
    axes = figure.subplots()
    for index, (name, trajectory) in enumerate(trajectories.items()):
        chosen = name == best
        axes.plot(
            *_thinned(trajectory.time, 1e3 * along(trajectory, roles, 0)),
            color=BEST_COLOUR if chosen else COLOURS[index % 5],
            linestyle="-" if chosen else STYLES[index % len(STYLES)],
            linewidth=2.2 if chosen else 1.5,
            label=name,
        )
    finish(axes, "time [s]", "marker forward [mm]")
    return figure


def panels(
    trajectories: Mapping[str, Trajectory], roles: Roles, axis: int = 0, best: str | None = None
) -> Figure:
    """Draw the marker's position along forward (0), left (1) or up (2), each gait in a panel of its own."""
    figure = Figure(figsize=(_WIDTH, 0.5 + 1.5 * len(trajectories)), layout="constrained")
    grid = figure.subplots(len(trajectories), 1, squeeze=False, sharex=True)
    for axes, (name, trajectory) in zip(grid[:, 0], trajectories.items(), strict=True):
        colour = BEST_COLOUR if name == best else COLOURS[0]
        axes.plot(*_thinned(trajectory.time, 1e3 * along(trajectory, roles, axis)), color=colour)
        axes.set_title(name, loc="left", fontsize=10)
        finish(axes, "", f"{('forward', 'left', 'up')[axis]} [mm]", legend=False)
    grid[-1, 0].set_xlabel("time [s]")
    return figure


def speeds(rows: Sequence[GaitRow | ComparedGait], best: str | None = None) -> Figure:
    """Draw mean forward speed with its 90 % interval and the worst scenario: one bar for each row."""
    figure = Figure(figsize=(_WIDTH, 1.0 + 0.45 * len(rows)), layout="constrained")
    axes = figure.subplots()
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
    axes.set_yticks(places, [row.name for row in rows])
    axes.axvline(0.0, color="k", linewidth=0.8)
    finish(axes, "forward speed [mm/s]", "", legend=False)
    legend_below(figure, axes, 2)
    return figure


def differences(rows: Sequence[ComparedGait]) -> Figure:
    """Draw by how much each gait after the first is faster than the first, scenario by scenario."""
    others = rows[1:]
    figure = Figure(figsize=(_WIDTH, 1.3 + 0.5 * len(others)), layout="constrained")
    axes = figure.subplots()
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
    axes.set_yticks(places, [row.name for row in others])
    axes.set_ylim(-0.6, len(others) - 0.4)
    axes.axvline(0.0, color="k", linewidth=0.8, linestyle="--")
    finish(axes, f"forward speed over that of {rows[0].name} [mm/s]", "", legend=False)
    legend_below(figure, axes, 2)
    return figure


def convergence(entries: Sequence[Entry], baselines: Mapping[str, float]) -> Figure:
    """Draw the speed of every evaluated gait, and of the best so far, against the baselines."""
    figure = Figure(figsize=(_WIDTH, 4.5), layout="constrained")
    axes = figure.subplots()
    groups = list(dict.fromkeys((entry.method, entry.rung) for entry in entries))
    for index, (method, rung) in enumerate(groups):
        chosen = [entry for entry in at_rung(entries, rung) if entry.method == method]
        met = np.array([entry.evaluation.constraints_met for entry in chosen])
        number = np.array([entry.index for entry in chosen])
        speed = 1e3 * np.array([entry.evaluation.metrics["speed_m_s"] for entry in chosen])
        planned = method == "plan"
        colour = BEST_COLOUR if planned else COLOURS[index % 5]
        mark, size = ("*", 11) if planned else (_MARKS[index % len(_MARKS)], 3.5)
        label = "plan (warm start)" if planned else method + ", lower fidelity" * (rung != WORKING)
        axes.plot(number[met], speed[met], mark, color=colour, markersize=size, label=label, zorder=3)
        bad = "*" if planned else "x"
        axes.plot(
            number[~met], speed[~met], bad, color=colour, markersize=max(size, 4.5), alpha=0.75, mfc="none"
        )
    axes.plot([], [], "kx", markersize=4, label="constraint violated")
    working = at_rung(entries)
    best = [1e3 * working[i].evaluation.metrics["speed_m_s"] for i in _leader_index(working)]
    number = np.array([entry.index for entry in working])
    axes.step(number, best, where="post", color="k", linewidth=1.5, label="best so far")
    for index, (name, speed_m_s) in enumerate(baselines.items()):
        axes.axhline(
            1e3 * speed_m_s, color="0.45", linestyle=STYLES[index % len(STYLES)], linewidth=1.0, label=name
        )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    finish(axes, "gait evaluated", "forward speed [mm/s]", legend=False)
    legend_below(figure, axes, 3)
    return figure


def front(
    entries: Sequence[Entry], found: Sequence[FrontGait], baselines: Mapping[str, tuple[float, float]]
) -> Figure:
    """Draw cost of transport over speed: every gait that keeps the limits, the front, the hand-tuned gaits.

    Args:
        entries: every gait evaluated.
        found: the gaits of the front, verified.
        baselines: speed, m/s, and cost of transport by name.
    """
    figure = Figure(figsize=(_WIDTH, 4.5), layout="constrained")
    axes = figure.subplots()
    able = [entry for entry in entries if entry.evaluation.constraints_met and speed(entry) > 0.0]
    able = [entry for entry in able if np.isfinite(transport(entry))]
    axes.plot(
        [1e3 * speed(e) for e in able], [transport(e) for e in able], ".", color="0.7", markersize=3,
        label="evaluated, limits kept",
    )  # fmt: skip
    for kept, mark, label in ((True, "o-", "front, verified"), (False, "x", "beaten once verified")):
        chosen = [(1e3 * one.verified.speed, one) for one in found if one.efficient == kept]
        costs = [one.verified.evaluation.metrics["cost_of_transport"] for _, one in chosen]
        if chosen:
            axes.plot([x for x, _ in chosen], costs, mark, color=BEST_COLOUR, markersize=6, label=label)
        for (x, one), cost in zip(chosen, costs, strict=True):
            name = one.verified.gait.name
            axes.annotate(name, (x, cost), fontsize=8, xytext=(4, 4), textcoords="offset points")
    for index, (name, (speed_m_s, cost)) in enumerate(baselines.items()):
        axes.plot(1e3 * speed_m_s, cost, _MARKS[index % 5], color=COLOURS[index % 5], label=name)
    axes.set_yscale("log")
    plain_ticks(axes.yaxis)
    finish(axes, "forward speed [mm/s]", "cost of transport [1]", legend=False)
    legend_below(figure, axes, 3)
    return figure


def gait_diagram(problem: Problem, gait: Gait, trajectory: Trajectory, robot: Robot) -> Figure:
    """Draw one cycle after the transient: what each servo does, and what each pad does on the ground."""
    chosen, cycle = _one_cycle(problem, gait, trajectory)
    names, pads = problem.channel_names, problem.roles.pads
    contacts = {pad: pad_states(problem, trajectory, pad, robot)[:, chosen] for pad in pads}
    rows = len(names) + bool(pads)
    figure = Figure(figsize=(_WIDTH, 0.6 + 1.6 * rows), layout="constrained")
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(grid, names, strict=False):
        _commanded_and_reached(axes, cycle, trajectory, name, chosen)
        for anchored, _, slipping in contacts.values():
            _shade(axes, cycle, anchored, color="0.5", alpha=0.15)
            _shade(axes, cycle, slipping, color=BEST_COLOUR, alpha=0.25)
        axes.set_title(name, loc="left", fontsize=10)
        finish(axes, "", "angle [°]", legend=name == names[0])
    if pads:
        _pad_bars(grid[-1], cycle, contacts)
    grid[-1].set_xlabel("share of the cycle")
    grid[-1].set_xlim(0.0, 1.0)
    return figure


def angles(problem: Problem, gait: Gait, trajectory: Trajectory, robot: Robot) -> Figure:
    """Draw commanded and reached angles over the measured cycles, with each servo's limits."""
    transient, measured = problem.simulation.horizon.cycles(gait.period_s)
    begin = transient * gait.period_s
    chosen = (trajectory.time >= begin) & (trajectory.time <= begin + min(measured, 3) * gait.period_s)
    time, names = trajectory.time[chosen], problem.channel_names
    figure = Figure(figsize=(_WIDTH, 0.8 + 1.8 * len(names)), layout="constrained")
    grid = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for index, (axes, name) in enumerate(zip(grid, names, strict=True)):
        _commanded_and_reached(axes, time, trajectory, name, chosen)
        for end in problem.file.channels[name].range_deg:
            axes.axhline(end, color="k", linestyle=":", linewidth=1.0)
        axes.plot([], [], "k:", linewidth=1.0, label="range of the servo")
        torque = np.abs(trajectory[f"torque.{name}"][chosen])
        full = torque >= _AT_LIMIT * robot.torque_limit[index]
        _shade(axes, time, full, color=COLOURS[1], alpha=0.4)
        axes.fill_between([], [], color=COLOURS[1], alpha=0.4, label="at the torque limit")
        limit = (
            f", torque limit {robot.torque_limit[index]:.3g} N m"
            if np.isfinite(robot.torque_limit[index])
            else ""
        )
        axes.set_title(f"{name}{limit}", loc="left", fontsize=10)
        finish(axes, "", "angle [°]", legend=False)
    grid[-1].set_xlabel("time [s]")
    legend_below(figure, grid[0], 4)
    return figure


def commanded(gait: Gait) -> Figure:
    """Draw what a gait commands each servo over one cycle."""
    cycle = np.linspace(0.0, 1.0, 1001)
    figure = Figure(figsize=(_WIDTH, 0.6 + 1.3 * len(gait.channels)), layout="constrained")
    grid = figure.subplots(len(gait.channels), 1, sharex=True, squeeze=False)[:, 0]
    targets = np.rad2deg(gait.targets(cycle * gait.period_s))
    for axes, name, series in zip(grid, gait.channels, targets.T, strict=True):
        axes.plot(cycle, series, color=COLOURS[0])
        axes.set_title(name, loc="left", fontsize=10)
        finish(axes, "", "angle [°]", legend=False)
    grid[-1].set_xlabel(f"share of the cycle of {gait.period_s:.3g} s")
    grid[-1].set_xlim(0.0, 1.0)
    return figure


def sensitivity(found: Sequence[Sensitivity], step: str) -> Figure:
    """Draw how the speed changes when one number of a gait or of a model does.

    Args:
        found: the numbers.
        step: the step, in words.
    """
    figure = Figure(figsize=(_WIDTH, 1.2 + 0.32 * len(found)), layout="constrained")
    axes = figure.subplots()
    ranked = sorted(found, key=lambda one: float(np.nan_to_num(max(abs(one.down), abs(one.up)))))
    places = np.arange(len(ranked))
    for index, (sign, hatch, shift) in enumerate((("down", "", -0.2), ("up", "//", 0.2))):
        widths = [1e3 * getattr(one, sign) for one in ranked]
        axes.barh(
            places + shift, widths, height=0.38, color=COLOURS[index], hatch=hatch, edgecolor="white",
            label=f"{step} {sign}",
        )  # fmt: skip
    slopes, noise = [1e3 * one.slope for one in ranked], [1e3 * one.noise for one in ranked]
    axes.errorbar(
        slopes, places, xerr=noise, fmt="k|", markersize=7, capsize=2, linewidth=0.9,
        label="half the difference, 90 % interval",
    )  # fmt: skip
    axes.set_yticks(places, [one.name for one in ranked], fontsize=8)
    axes.axvline(0.0, color="k", linewidth=0.8)
    axes.margins(y=0.02)
    finish(axes, "change of the forward speed [mm/s]", "", legend=False)
    legend_below(figure, axes, 3)
    return figure


def findings(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw by how much each finding of an audit exceeds its limit."""
    shown = [row for row in rows if row["limit"] > 0.0 and np.isfinite(row["value"]) and row["value"] > 0.0]
    ratios = np.array([beyond(row["value"], row["limit"]) for row in shown])
    figure = Figure(figsize=(_WIDTH, 1.2 + 0.32 * max(1, len(shown))), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(shown))[::-1]
    axes.barh(places, ratios, color=COLOURS[0], height=0.6)
    axes.axvline(1.0, color="k", linestyle="--", linewidth=1.2, label="limit")
    labels = [title_of(row["name"]) + (f": {row['gait']}" if row["gait"] else "") for row in shown]
    axes.set_yticks(places, labels, fontsize=8)
    if len(shown) and ratios.max() > 20.0:
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
    finish(axes, "times its limit [1]", "")
    return figure


def beyond(value: float, limit: float) -> float:
    """Return how far a finding lies beyond its limit: of shares that should be larger, limit over value."""
    return max(value / limit, limit / value) if value > 0.0 else np.inf


def along(trajectory: Trajectory, roles: Roles, axis: int) -> NDArray[np.float64]:
    """Return how far the marker has moved from its start along forward, left or up, m, shape (n,)."""
    marker = trajectory.stacked("marker")
    moved: NDArray[np.float64] = (marker - marker[:1]) @ roles.axes[axis]
    return moved


def finish(axes: Axes, x: str, y: str, legend: bool = True) -> None:
    """Label the axes and give a panel the look of all figures."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(color="0.85", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if legend:
        axes.legend(fontsize=8.5, framealpha=0.9, loc="best")


def plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers, the small ticks too where it spans few decades."""
    axis.set_major_formatter(_PlainLog())
    axis.set_minor_formatter(_PlainLog(minor_thresholds=(2, 0.5)))


class _PlainLog(LogFormatter):
    """Labels where Matplotlib's own formatter has some, without powers."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend under a figure, where it hides nothing."""
    figure.legend(
        *axes.get_legend_handles_labels(),
        loc="outside lower center",
        ncols=columns,
        fontsize=8.5,
        frameon=False,
    )


# --- parts ------------------------------------------------------------------------------------


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


def _commanded_and_reached(
    axes: Axes, x: NDArray[np.float64], trajectory: Trajectory, name: str, chosen: NDArray[np.bool_]
) -> None:
    commanded = np.rad2deg(trajectory[f"target.{name}"][chosen])
    reached = np.rad2deg(trajectory[f"position.{name}"][chosen])
    axes.plot(*_thinned(x, commanded), "--", color="0.25", linewidth=1.4, label="commanded")
    axes.plot(*_thinned(x, reached), color=COLOURS[0], linewidth=1.6, label="reached")


def _one_cycle(
    problem: Problem, gait: Gait, trajectory: Trajectory
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which samples lie in the first cycle after the transient, and where in the cycle they lie."""
    transient, _ = problem.simulation.horizon.cycles(gait.period_s)
    begin = transient * gait.period_s
    chosen = (trajectory.time >= begin) & (trajectory.time <= begin + gait.period_s)
    return chosen, (trajectory.time[chosen] - begin) / gait.period_s


def pad_states(problem: Problem, trajectory: Trajectory, pad: str, robot: Robot) -> NDArray[np.bool_]:
    """Return when a pad is anchored, when it slides forward and when it slips back, shape (3, n).

    Load and speed are means over 20 ms, as contacts chatter.
    """
    forward, _, up = problem.roles.axes
    load = np.stack([trajectory[f"load.{pad}.{axis}"] for axis in "xyz"], axis=1) @ up
    speed = np.stack([trajectory[f"pad_speed.{pad}.{axis}"] for axis in "xyz"], axis=1) @ forward
    step = float(np.median(np.diff(trajectory.time))) if len(trajectory.time) > 1 else 1.0
    width = max(1, round(0.02 / step))
    load, speed = (_smoothed(series, width) for series in (np.abs(load), speed))
    loaded = load > LOADED * robot.weight
    return np.stack(
        [
            loaded & (np.abs(speed) <= _SLIDING_M_S),
            loaded & (speed > _SLIDING_M_S),
            loaded & (speed < -_SLIDING_M_S),
        ]
    )


def _pad_bars(axes: Axes, cycle: NDArray[np.float64], contacts: Mapping[str, NDArray[np.bool_]]) -> None:
    """Draw a row of bars for each pad: solid where it holds, hatched where it slides."""
    looks: list[dict[str, Any]] = [
        {"label": "anchored", "facecolor": "0.35"},
        {"label": "slides forward", "facecolor": COLOURS[4], "hatch": "..", "edgecolor": "white"},
        {"label": "slips back", "facecolor": BEST_COLOUR, "hatch": "////", "edgecolor": "white"},
    ]
    for row, states in enumerate(contacts.values()):
        for state, look in zip(states, looks, strict=True):
            spans = [(a, b - a) for a, b in _spans(cycle, state)]
            axes.broken_barh(
                spans, (row - 0.35, 0.7), **(look | {"label": look["label"] if row == 0 else None})
            )
    axes.set_yticks(range(len(contacts)), list(contacts))
    axes.set_ylim(len(contacts) - 0.4, -0.6)
    axes.set_title("pads under load", loc="left", fontsize=10)
    finish(axes, "", "", legend=False)
    figure = axes.get_figure(root=True)
    assert figure is not None
    legend_below(figure, axes, 3)


def _shade(axes: Axes, x: NDArray[np.float64], where: NDArray[np.bool_], **look: Any) -> None:
    for begin, end in _spans(x, where):
        axes.axvspan(begin, end, linewidth=0.0, zorder=0, **look)


def _spans(x: NDArray[np.float64], where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return the ends of the intervals of `x` in which `where` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    ends = np.append(x, x[-1:])
    return [(float(ends[a]), float(ends[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _thinned(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    every = max(1, len(x) // _POINTS)
    return x[::every], y[::every]


def _leader_index(entries: Sequence[Entry]) -> list[int]:
    leader, indices = 0, []
    for i, entry in enumerate(entries):
        if entry.evaluation.cost < entries[leader].evaluation.cost:
            leader = i
        indices.append(leader)
    return indices


def _smoothed(series: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    return np.convolve(series, np.full(width, 1.0 / width), mode="same")
