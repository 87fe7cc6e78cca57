"""Figures: each a function from records to a Matplotlib figure, with units and a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gaitopt.gait import Gait
from gaitopt.optimise.journal import Entry
from gaitopt.problem import Problem
from gaitopt.trajectory import Trajectory

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#000000")
"""Okabe and Ito's palette, which colour-blind readers can tell apart; styles differ too, for print."""

STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-")
BEST_COLOUR = "#d55e00"


def overlay(trajectories: Mapping[str, Trajectory], best: str | None = None) -> Figure:
    """Draw the marker's forward position of several gaits in one picture."""
    figure, axes = plt.subplots(figsize=(8.0, 4.5), layout="constrained")
    for index, (name, trajectory) in enumerate(trajectories.items()):
        chosen = name == best
        axes.plot(
            trajectory.time,
            1e3 * (trajectory["marker.x"] - trajectory["marker.x"][0]),
            color=BEST_COLOUR if chosen else COLOURS[index % 5],
            linestyle="-" if chosen else STYLES[index % len(STYLES)],
            linewidth=2.2 if chosen else 1.5,
            label=name,
        )
    finish(axes, "time [s]", "marker forward [mm]")
    return figure


def panels(trajectories: Mapping[str, Trajectory]) -> Figure:
    """Draw the marker's forward position of each gait in a panel of its own."""
    figure, grid = plt.subplots(
        len(trajectories), 1, figsize=(8.0, 1.9 * len(trajectories)), layout="constrained", squeeze=False
    )
    for axes, (name, trajectory) in zip(grid[:, 0], trajectories.items(), strict=True):
        axes.plot(
            trajectory.time, 1e3 * (trajectory["marker.x"] - trajectory["marker.x"][0]), color=COLOURS[0]
        )
        axes.set_title(name, loc="left", fontsize=10)
        finish(axes, "time [s]", "forward [mm]", legend=False)
    return figure


def convergence(entries: Sequence[Entry], baselines: Mapping[str, float]) -> Figure:
    """Draw the speed of every evaluated gait, and of the best so far, against the baselines."""
    figure, axes = plt.subplots(figsize=(8.0, 4.5), layout="constrained")
    methods = list(dict.fromkeys(entry.method for entry in entries))
    for index, method in enumerate(methods):
        chosen = [entry for entry in entries if entry.method == method]
        met = np.array([entry.evaluation.constraints_met for entry in chosen])
        number = np.array([entry.index for entry in chosen])
        speed = 1e3 * np.array([entry.evaluation.metrics["speed_m_s"] for entry in chosen])
        colour = COLOURS[index % 5]
        axes.plot(number[met], speed[met], "o", color=colour, markersize=3, label=method)
        axes.plot(number[~met], speed[~met], "x", color=colour, markersize=3, alpha=0.5)
    axes.plot([], [], "kx", markersize=4, label="constraint violated")
    leaders = np.minimum.accumulate([entry.evaluation.cost for entry in entries])
    best = [entries[i].evaluation.metrics["speed_m_s"] for i in _leader_index(entries)]
    axes.step(
        range(len(leaders)), 1e3 * np.array(best), where="post", color="k", linewidth=1.5, label="best so far"
    )
    for index, (name, speed_m_s) in enumerate(baselines.items()):
        axes.axhline(
            1e3 * speed_m_s, color="0.45", linestyle=STYLES[index % len(STYLES)], linewidth=1.0, label=name
        )
    finish(axes, "gait evaluated", "forward speed [mm/s]")
    return figure


def gait_diagram(problem: Problem, gait: Gait, trajectory: Trajectory) -> Figure:
    """Draw what each servo does over one cycle after the transient: commanded and reached."""
    transient, _ = problem.simulation.horizon.cycles(gait.period_s)
    begin = transient * gait.period_s
    chosen = (trajectory.time >= begin) & (trajectory.time <= begin + gait.period_s)
    cycle = (trajectory.time[chosen] - begin) / gait.period_s
    names = problem.channel_names
    figure, grid = plt.subplots(
        len(names) + 1, 1, figsize=(8.0, 1.7 * (len(names) + 1)), layout="constrained", sharex=True
    )
    for axes, name in zip(grid, names, strict=False):
        axes.plot(
            cycle, np.rad2deg(trajectory[f"target.{name}"][chosen]), "--", color="0.3", label="commanded"
        )
        axes.plot(
            cycle, np.rad2deg(trajectory[f"position.{name}"][chosen]), color=COLOURS[0], label="reached"
        )
        axes.set_title(name, loc="left", fontsize=10)
        finish(axes, "", "angle [°]")
    for index, pad in enumerate(problem.roles.pads):
        load = np.abs(trajectory[f"load.{pad}.z"][chosen])
        grid[-1].plot(cycle, _smoothed(load), color=COLOURS[index + 1], linestyle=STYLES[index], label=pad)
    grid[-1].set_title("load on the pads, mean over a fiftieth of the cycle", loc="left", fontsize=10)
    finish(grid[-1], "share of the cycle", "load [N]")
    return figure


def _leader_index(entries: Sequence[Entry]) -> list[int]:
    leader, indices = 0, []
    for i, entry in enumerate(entries):
        if entry.evaluation.cost < entries[leader].evaluation.cost:
            leader = i
        indices.append(leader)
    return indices


def _smoothed(series: np.ndarray) -> np.ndarray:
    width = max(1, len(series) // 50)
    return np.convolve(series, np.full(width, 1.0 / width), mode="same")


def finish(axes: Axes, x: str, y: str, legend: bool = True) -> None:
    """Label the axes and give a panel the look of all figures."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(color="0.85", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    if legend:
        axes.legend(fontsize=8, framealpha=0.9, loc="best")
