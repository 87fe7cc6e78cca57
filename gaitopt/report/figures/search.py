"""Figures of a search: its convergence, speed against cost of transport, and what the speed depends on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from gaitopt.optimise.journal import WORKING, Entry, at_rung
from gaitopt.optimise.pareto import FrontGait, speed, transport
from gaitopt.optimise.sensitivity import Sensitivity
from gaitopt.optimise.verification import Verified
from gaitopt.report.figures.style import (
    BEST_COLOUR,
    COLOURS,
    MARKS,
    STYLES,
    finish,
    legend_below,
    name_rows,
    plain_ticks,
    single_panel,
)
from gaitopt.report.letters import WIDEST_IN_LEGEND, drawable


def convergence(entries: Sequence[Entry], baselines: Sequence[Verified]) -> Figure:
    """Draw the speed of every evaluated gait, and of the best so far, against the baselines."""
    figure, axes = single_panel(4.5)
    groups = list(dict.fromkeys((entry.method, entry.rung) for entry in entries))
    for index, (method, rung) in enumerate(groups):
        chosen = [entry for entry in at_rung(entries, rung) if entry.method == method]
        if method == "plan":
            _evaluated(axes, chosen, "plan (warm start)", BEST_COLOUR, "*")
        else:
            label = method + ", lower fidelity" * (rung != WORKING)
            _evaluated(axes, chosen, label, COLOURS[index % 5], MARKS[index % len(MARKS)])
    axes.plot([], [], "ko", markersize=4.5, markerfacecolor="none", label="hollow: constraint violated")
    _best_so_far(axes, at_rung(entries))
    for index, baseline in enumerate(baselines):
        style = STYLES[index % len(STYLES)]
        axes.axhline(
            1e3 * baseline.speed,
            color="0.35",
            linestyle=style,
            linewidth=1.0,
            label=drawable(baseline.gait.name, WIDEST_IN_LEGEND),
        )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    finish(axes, "gait evaluated", "forward speed [mm/s]", legend=False)
    legend_below(figure, axes, 3)
    return figure


def _evaluated(axes: Axes, entries: Sequence[Entry], label: str, colour: str, mark: str) -> None:
    """Draw the gaits of one method: filled marks meet the constraints, hollow ones do not."""
    met = np.array([entry.evaluation.constraints_met for entry in entries])
    number = np.array([entry.index for entry in entries])
    speeds = 1e3 * np.array([speed(entry) for entry in entries])
    size = 11.0 if mark == "*" else 4.5
    for chosen, fill in ((met, colour), (~met, "none")):
        if chosen.any():  # the legend has the method's first mark
            axes.plot(number[chosen], speeds[chosen], mark, color=colour, ms=size, mfc=fill, label=label)
            label = f"_{label}"


def _best_so_far(axes: Axes, entries: Sequence[Entry]) -> None:
    """Draw the speed of the gait that costs least so far; the search counts violations as costs."""
    leader = entries[0]
    best = []
    for entry in entries:
        if entry.evaluation.cost < leader.evaluation.cost:
            leader = entry
        best.append(1e3 * speed(leader))
    number = np.array([entry.index for entry in entries])
    axes.step(number, best, where="post", color="k", linewidth=1.5, label="best so far")


def front(entries: Sequence[Entry], found: Sequence[FrontGait], baselines: Sequence[Verified]) -> Figure:
    """Draw cost of transport over speed: every gait that keeps the limits, the front, the hand-tuned gaits.

    Args:
        entries: every gait evaluated.
        found: the gaits of the front, verified.
        baselines: the hand-tuned gaits, verified.
    """
    figure, axes = single_panel(4.5)
    able = [entry for entry in entries if entry.evaluation.constraints_met and speed(entry) > 0.0]
    able = [entry for entry in able if np.isfinite(transport(entry))]
    axes.plot(
        [1e3 * speed(e) for e in able], [transport(e) for e in able], ".", color="0.35", markersize=4,
        label="evaluated, limits kept",
    )  # fmt: skip
    _front_gaits(axes, [one.verified for one in found if one.efficient], "o-", "front, verified")
    _front_gaits(axes, [one.verified for one in found if not one.efficient], "x", "beaten once verified")
    for index, baseline in enumerate(baselines):
        axes.plot(
            1e3 * baseline.speed, _transport(baseline), MARKS[index % 5], color=COLOURS[index % 5],
            label=drawable(baseline.gait.name, WIDEST_IN_LEGEND),
        )  # fmt: skip
    axes.set_yscale("log")
    plain_ticks(axes.yaxis)
    finish(axes, "forward speed [mm/s]", "cost of transport [1]", legend=False)
    legend_below(figure, axes, 3)
    _name_gaits(figure, axes, [one.verified for one in found])
    return figure


def _front_gaits(axes: Axes, gaits: Sequence[Verified], mark: str, label: str) -> None:
    """Draw verified gaits."""
    points = [(1e3 * one.speed, _transport(one)) for one in gaits]
    if points:
        axes.plot(*zip(*points, strict=True), mark, color=BEST_COLOUR, markersize=6, label=label)


_PLACES = ((5, 5, "left"), (-5, 5, "right"), (5, -12, "left"), (-5, -12, "right"))
"""Where a name may stand beside its point: offset in points, and the side that it begins at."""


def _name_gaits(figure: Figure, axes: Axes, gaits: Sequence[Verified]) -> None:
    """Write the names of gaits beside their points, each where it covers no other name, point or edge.

    A name without such a place is left out.
    """
    figure.draw_without_rendering()
    window = axes.get_window_extent()
    drawn = [line.get_transform().transform(line.get_xydata()) for line in axes.lines]
    points = np.concatenate([one[np.isfinite(one).all(axis=1)] for one in drawn])
    taken: list[Bbox] = []
    for one in gaits:
        name, at = drawable(one.gait.name, WIDEST_IN_LEGEND), (1e3 * one.speed, _transport(one))
        for right, up, side in _PLACES:
            text = axes.annotate(
                name, at, xytext=(right, up), textcoords="offset points", ha=side, fontsize=8
            )
            box = text.get_window_extent()
            inside = window.containsx(box.x0) and window.containsx(box.x1) and window.containsy(box.y0)
            if inside and not box.count_contains(points) and not box.count_overlaps(taken):
                taken.append(box)
                break
            text.remove()


def _transport(verified: Verified) -> float:
    return verified.evaluation.metrics["cost_of_transport"]


def sensitivity(found: Sequence[Sensitivity], step: str) -> Figure:
    """Draw how the speed changes when one number of a gait or of a model does.

    Args:
        found: the numbers.
        step: the step, in words.
    """
    figure, axes = single_panel(1.2 + 0.32 * len(found))
    ranked = sorted(found, key=lambda one: float(np.nan_to_num(max(abs(one.down), abs(one.up)))))
    places = np.arange(len(ranked))
    sides = (("down", [one.down for one in ranked], "", -0.2), ("up", [one.up for one in ranked], "//", 0.2))
    for index, (side, changes, hatch, shift) in enumerate(sides):
        axes.barh(
            places + shift, [1e3 * change for change in changes], height=0.38, color=COLOURS[index],
            hatch=hatch, edgecolor="white", label=f"{step} {side}",
        )  # fmt: skip
    slopes, noise = [1e3 * one.slope for one in ranked], [1e3 * one.noise for one in ranked]
    axes.errorbar(
        slopes, places, xerr=noise, fmt="k|", markersize=7, capsize=2, linewidth=0.9,
        label="half the difference, 90 % interval",
    )  # fmt: skip
    name_rows(axes, places.tolist(), [one.name for one in ranked], 8.0)
    axes.axvline(0.0, color="k", linewidth=0.8)
    axes.margins(y=0.02)
    finish(axes, "change of the forward speed [mm/s]", "", legend=False)
    legend_below(figure, axes, 3)
    return figure
