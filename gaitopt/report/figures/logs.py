"""Figures of a diagnosis of logged commands: angles and residuals by command, and components."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.leftover import channel_of
from gaitopt.diagnose.gap.split_commands import COMMAND_COMPONENTS
from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.record.defect import runs
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.diagnose.words import name_of_component
from gaitopt.report.figures.style import (
    BEST_COLOUR,
    COLOURS,
    WIDTH,
    PlainFigure,
    finish,
    legend_below,
    name_panel,
    name_rows,
    plain_ticks,
    single_panel,
    width,
)
from gaitopt.report.letters import drawable
from gaitopt.robot.signals import is_position

_Place = Literal["outside upper center", "outside lower center"]

_COMMAND_COLOUR = "0.35"
_NOMINAL_COLOUR = "0.25"
_COMPONENT_COLOURS = (*COLOURS[:6], "0.25", "0.35")
_HATCHES = ("", "//", "..", "xx", "\\\\", "--", "", "||")
_FLOORS_SHOWN = 3.0
"""What is left is shown to this many floors at least, and as far as the corrected robot's goes."""

_COLUMNS = 3
"""Panels beside one another in the overview."""


@dataclass(frozen=True)
class Repeats:
    """Trials of one log of commands.

    Attributes:
        trials: the trials beside the nominal robot.
        after: the same beside the corrected robot; none where there is none.
    """

    trials: Sequence[TrialGap]
    after: Sequence[Aligned] = ()

    @property
    def name(self) -> str:
        """Names of the trials, short where there are many."""
        names = [trial.name for trial in self.trials]
        return " and ".join(names) if len(names) < 3 else f"{names[0]} and {len(names) - 1} repeats"

    @property
    def short_name(self) -> str:
        """Name of the first of them, and how many there are."""
        count = len(self.trials)
        return self.trials[0].name + (f" (×{count})" if count > 1 else "")

    @property
    def signals(self) -> list[str]:
        """Signals that any of the trials measured."""
        return list(dict.fromkeys(name for trial in self.trials for name in trial.splits))

    @property
    def worst(self) -> float:
        """The largest gap of any signal in any trial, in floors."""
        return max(max(trial.ratios.values()) for trial in self.trials)


def responses(repeats: Repeats) -> Figure:
    """Draw each signal of the trials of one log over time, and under it what is left, with the floor."""
    names = repeats.signals
    figure = PlainFigure(figsize=(width(), 0.7 + 3.3 * len(names)), layout="constrained")
    grid = figure.subplots(
        2 * len(names), 1, squeeze=False, sharex=True, height_ratios=[2.0, 1.0] * len(names)
    )[:, 0]
    for name, above, below in zip(names, grid[::2], grid[1::2], strict=True):
        _motion(above, repeats, name)
        finish(above, "", _label(name), legend=False)
        name_panel(above, name)
        _residuals(below, repeats, name)
        finish(below, "", f"left {_unit(name)}", legend=False)
    grid[-1].set_xlabel("time on the clock of the log [s]")
    _legend(figure, grid, "outside lower center", 4)
    return figure


def overview(rows: Sequence[Repeats], signal: str) -> Figure:
    """Draw one signal under every log of commands, a small panel each."""
    shown = [repeats for repeats in rows if signal in repeats.signals]
    columns = min(_COLUMNS if width() == WIDTH else 2, len(shown))
    lines = math.ceil(len(shown) / columns)
    figure = PlainFigure(figsize=(width(), 0.8 + 1.35 * lines), layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False).ravel()
    for axes, repeats in zip(grid, shown, strict=False):
        _motion(axes, repeats, signal)
        finish(axes, "", "", legend=False)
        axes.tick_params(labelsize=6.5)
        axes.set_title(drawable(repeats.short_name, 18.0), fontsize=7.5, loc="left")
    for axes in grid[len(shown) :]:
        axes.set_axis_off()
    figure.supxlabel("time on the clock of the log [s]", fontsize=9)
    figure.supylabel(_label(signal), fontsize=9)
    _legend(figure, grid, "outside upper center", 5)
    return figure


def components(rows: Sequence[Repeats]) -> Figure:
    """Draw the components of the gap of each signal under each log, in floors, as the mean of its repeats."""
    bars = [(repeats, name) for repeats in rows for name in repeats.signals]
    figure, axes = single_panel(0.3 * len(bars) + 1.5)
    places = np.arange(len(bars))[::-1]
    left = np.zeros(len(bars))
    for component, colour, hatch in zip(COMMAND_COMPONENTS, _COMPONENT_COLOURS, _HATCHES, strict=True):
        widths = np.array([_floors(repeats, name, component) for repeats, name in bars])
        label = name_of_component(component)
        axes.barh(places, widths, left=left, color=colour, hatch=hatch, edgecolor="white", label=label)
        left += widths
    many = len({name for _, name in bars}) > 1
    labels = [f"{repeats.short_name}{f': {name}' if many else ''}" for repeats, name in bars]
    name_rows(axes, places.tolist(), labels, 8.0)
    axes.margins(y=0.02)
    axes.axvline(1.0, color="k", lw=1.0, ls="--", label="the floor")
    finish(axes, "gap [floors]; parts by their share of its square", "", legend=False)
    legend_below(figure, axes, 3)
    return figure


def _legend(figure: Figure, panels: Iterable[Axes], place: _Place, columns: int) -> None:
    """Put one legend of everything in some panels outside of them."""
    handles: dict[str, Artist] = {}
    for axes in panels:
        lines, labels = axes.get_legend_handles_labels()
        handles |= dict(zip(labels, lines, strict=True))
    figure.legend(handles.values(), handles.keys(), loc=place, ncols=columns, fontsize=8.5, frameon=False)


def held_out(rows: Sequence[tuple[str, Gap]]) -> Figure:
    """Draw the RMS error of the angles under each log, before and after, and the floor.

    Args:
        rows: name and gap of each log, rad.
    """
    figure, axes = single_panel(1.3 + 0.4 * len(rows))
    places = np.arange(len(rows))[::-1]
    looks = (
        ([gap.before for _, gap in rows], 0.12, "0.35", "s", "nominal"),
        ([gap.after for _, gap in rows], -0.12, BEST_COLOUR, "o", "corrected"),
    )
    for values, shift, colour, mark, label in looks:  # no bars, which begin nowhere on this axis
        axes.plot(np.rad2deg(values), places + shift, mark, color=colour, ms=5.5, label=label)
    axes.plot(np.rad2deg([gap.floor for _, gap in rows]), places, "k|", ms=15, mew=1.6, label="the floor")
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    axes.tick_params(axis="x", which="both", labelsize=7.5)
    name_rows(axes, places.tolist(), [name for name, _ in rows], 8.0)
    axes.margins(y=0.02)
    finish(axes, "RMS error of the angles, held out [°]", "", legend=False)
    legend_below(figure, axes, 3)
    return figure


def _motion(axes: Axes, repeats: Repeats, name: str) -> None:
    """Draw what was commanded, measured and simulated."""
    first = next(trial.aligned for trial in repeats.trials if name in trial.splits)
    scale, origin = _scale(name), _origin(first, name)
    channel = channel_of(first.simulated, name)
    if channel is not None:
        targets = first.trial.drive.targets(first.time)[:, channel]
        axes.step(first.time, scale * targets, where="post", color=_COMMAND_COLOUR, lw=1.0, label="commanded")
    _unpowered(axes, first)
    axes.plot(
        first.time,
        scale * (first.predicted[name] - origin),
        "--",
        color=_NOMINAL_COLOUR,
        lw=1.1,
        label="nominal",
    )
    for number, trial in enumerate(repeats.trials):
        if name in trial.splits:
            _recording(axes, trial.aligned, name, number)
    for number, after in enumerate(_after(repeats, name)[:1]):
        label = "corrected" if number == 0 else None
        moved = after.predicted[name] - _origin(after, name)
        axes.plot(after.time, scale * moved, color=BEST_COLOUR, lw=1.3, label=label)


def _unpowered(axes: Axes, aligned: Aligned) -> None:
    """Shade the times at which no servo has power."""
    off = np.atleast_1d(np.isnan(aligned.trial.drive.targets(aligned.time)).all(axis=1))
    for number, (begin, end) in enumerate(runs(off)):
        last = aligned.time[min(end, len(off) - 1)]
        label = "unpowered" if number == 0 else "_unpowered"
        axes.axvspan(aligned.time[begin], last, color="0.85", alpha=0.6, lw=0.0, zorder=0.5, label=label)


def _recording(axes: Axes, aligned: Aligned, name: str, number: int) -> None:
    """Draw the samples of one repeat."""
    used = aligned.trial.used[name]
    series = _scale(name) * (aligned.trial.signals[name] - _origin(aligned, name))
    label = "measured" if number == 0 else "_measured"
    size = 2.5 if len(series) > 60 else 4.0
    axes.plot(aligned.time[used], series[used], ".", color=COLOURS[0], ms=size, zorder=1.5, label=label)
    masked = ~used & np.isfinite(series)
    if masked.any():
        axes.plot(aligned.time[masked], series[masked], "x", color="0.35", ms=4, mew=0.8, label="_measured")


def _residuals(axes: Axes, repeats: Repeats, name: str) -> None:
    """Draw what the nominal and the corrected robot leave of each repeat, over the floor."""
    scale = _scale(name)
    trials = [trial for trial in repeats.trials if name in trial.splits]
    floor = scale * max(trial.floors[name].total for trial in trials)
    axes.axhspan(-floor, floor, color=COLOURS[4], alpha=0.45, lw=0.0, label="the floor")
    sets = (
        ([trial.aligned for trial in trials], _NOMINAL_COLOUR, "--", "left by nominal"),
        (_after(repeats, name), BEST_COLOUR, "-", "left by corrected"),
    )
    after = [scale * float(np.nanmax(np.abs(one.residual[name]))) for one in _after(repeats, name)]
    reach = max(_FLOORS_SHOWN * floor, 1.2 * max(after)) if after else np.inf
    for recordings, colour, style, label in sets:
        for number, aligned in enumerate(recordings):
            left = scale * aligned.residual[name]
            axes.plot(
                aligned.time,
                np.where(np.abs(left) <= reach, left, np.nan),
                style,
                color=colour,
                lw=0.9,
                label=label if number == 0 else f"_{label}",
            )
    if after:
        axes.set_ylim(-reach, reach)


def _after(repeats: Repeats, name: str) -> list[Aligned]:
    return [aligned for aligned in repeats.after if name in aligned.residual]


def _floors(repeats: Repeats, name: str, component: str) -> float:
    """Return a component's part of the length of a bar that is as long as the gap, in floors."""
    trials = [trial for trial in repeats.trials if name in trial.splits]
    floor = float(np.mean([trial.floors[name].total for trial in trials]))
    square = float(np.mean([trial.splits[name].squares[component] for trial in trials]))
    gap = math.sqrt(float(np.mean([trial.splits[name].rms ** 2 for trial in trials])))
    return square / (gap or 1.0) / floor if floor > 0.0 else 0.0


def _origin(aligned: Aligned, name: str) -> float:
    """Return where a panel has its zero: 0 of angles, the lowest prediction of coordinates."""
    return float(np.nanmin(aligned.predicted[name])) if is_position(name) else 0.0


def _scale(name: str) -> float:
    return 1e3 if is_position(name) else math.degrees(1.0)


def _unit(name: str) -> str:
    return "[mm]" if is_position(name) else "[°]"


def _label(name: str) -> str:
    return f"{drawable(name)} [mm]" if is_position(name) else "angle [°]"
