"""Figures of a diagnosis: measured against simulated, where in the cycle, and which component."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gaitopt.core.statistics import NORMAL_95
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import marker_floor
from gaitopt.diagnose.gap.split import COMPONENTS
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.report.figures.style import (
    BEST_COLOUR,
    COLOURS,
    finish,
    legend_below,
    name_panel,
    name_rows,
    plain_ticks,
    single_panel,
    stacked_panels,
)
from gaitopt.report.letters import WIDEST_IN_LEGEND, drawable
from gaitopt.robot.signals import is_position, name_of

_LONG = 32
"""Letters of a name beside which little is left for the label of an axis."""

_SHOWN = 12
"""Candidates in the ranking."""

_LEAST = 0.02
"""Share of a value that the lower end of its interval is drawn at, at least."""

_MASKED_COLOUR = "0.35"
_RANK_COLOURS = {"no effect": "0.35"}
_HATCHES = ("", "//", "..", "xx", "\\\\")


def measured_and_simulated(trial: TrialGap, after: Aligned | None = None) -> Figure:
    """Draw every measured signal of a trial over its prediction, and mark samples that do not count.

    Args:
        trial: the trial beside the nominal robot.
        after: the same trial beside the corrected robot.
    """
    names = list(trial.splits)
    figure, grid = stacked_panels(len(names), 0.6 + 1.7 * len(names))
    for axes, name in zip(grid, names, strict=True):
        _signal(axes, trial, name, after)
        finish(axes, "", _label(name), legend=False)
        name_panel(axes, name)
    grid[-1].set_xlabel("gait time [s]")
    legend_below(figure, grid[0], 4)
    return figure


def _signal(axes: Axes, trial: TrialGap, name: str, after: Aligned | None) -> None:
    """Draw one signal, and time stamps as recorded where they were corrected."""
    aligned, recorded = trial.aligned, trial.cleaned.recorded
    scale, origin = _scale(name), float(np.nanmin(aligned.predicted[name]))
    used = aligned.trial.used[name]
    moved = recorded.time != aligned.trial.time
    measured = scale * (aligned.trial.signals[name] - origin)
    axes.plot(
        aligned.time, scale * (aligned.predicted[name] - origin), "--", color="0.25", lw=1.1, label="nominal"
    )
    if after is not None:
        shift = after.offset_s - aligned.offset_s
        corrected = scale * (after.predicted[name] - origin)
        axes.plot(after.time - shift, corrected, color=BEST_COLOUR, lw=1.3, label="corrected")
    axes.plot(aligned.time[used], measured[used], ".", color=COLOURS[0], ms=2.5, zorder=1.5, label="measured")
    masked = ~used & np.isfinite(measured)
    if masked.any():
        axes.plot(
            aligned.time[masked], measured[masked], "x", color=_MASKED_COLOUR, ms=4, mew=0.8, label="masked"
        )
    if moved.any():
        raw = recorded.time[moved] + aligned.offset_s
        axes.plot(raw, measured[moved], "|", color=COLOURS[3], ms=4, mew=0.7, label="stamp corrected")


def components(trials: Sequence[TrialGap]) -> Figure:
    """Draw the components of the gap of each signal of some trials of gaits, in floors."""
    bars = [(trial, name) for trial in trials for name in trial.splits]
    figure, axes = single_panel(0.3 * len(bars) + 1.5)
    places = np.arange(len(bars))[::-1]
    left = np.zeros(len(bars))
    for index, component in enumerate(COMPONENTS):
        widths = np.array([_floors(trial, name, component) for trial, name in bars])
        axes.barh(
            places,
            widths,
            left=left,
            color=COLOURS[index],
            hatch=_HATCHES[index],
            edgecolor="white",
            label=component,
        )
        left += widths
    labels = [f"{trial.name}: {name}{'' if trial.counts else ' (below its floor)'}" for trial, name in bars]
    name_rows(axes, places.tolist(), labels, 8.0)
    axes.margins(y=0.02)
    axes.axvline(1.0, color="k", lw=1.0, ls="--", label="the floor")
    finish(axes, "gap [floors]; parts by their share of its square", "", legend=False)
    legend_below(figure, axes, 3)
    return figure


def ranking(found: Causes) -> Figure:
    """Draw the error that the best candidates leave on held-out trials, beside that without any effect."""
    firsts: dict[str, float] = {"no effect": float(found.none.heldout_loss.sum())}
    errors = {"no effect": 0.0}
    best = found.candidates[0]
    for candidate in found.candidates:
        if candidate.label not in firsts and len(firsts) <= _SHOWN:
            apart = candidate.heldout_loss - best.heldout_loss
            firsts[candidate.label] = float(candidate.heldout_loss.sum())
            errors[candidate.label] = float(np.sqrt(len(apart)) * apart.std())
    rows = float(found.trial_set.rows_per_block.sum())
    names = sorted(firsts, key=lambda name: firsts[name])
    figure, axes = single_panel(0.3 * len(names) + 1.2)
    places = np.arange(len(names))[::-1]
    for place, name in zip(places.tolist(), names, strict=True):
        colour = _RANK_COLOURS.get(name, BEST_COLOUR if name == best.label else COLOURS[0])
        error, left = NORMAL_95 * errors[name] / rows, firsts[name] / rows
        lower = min(error, (1.0 - _LEAST) * left)  # a logarithmic axis has no place for 0
        axes.errorbar(left, place, xerr=[[lower], [error]], fmt="o", color=colour, ms=6, capsize=3)
    name_rows(axes, places.tolist(), names, 8.0)
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    axes.axvline(1.0, color="k", lw=1.0, ls="--")
    axes.margins(y=0.02)
    finish(axes, "error left on held-out data [1 = a right model]", "", legend=False)
    if max(map(len, names)) > _LONG:
        axes.xaxis.set_label_coords(1.0, -0.5 / figure.get_figheight())
        axes.xaxis.label.set_horizontalalignment("right")
    return figure


def profile(found: Causes, fit: Fit) -> Figure:
    """Draw the loss along the parameter of the winner, and the values that were simulated.

    Args:
        found: the causes; the first candidate is one effect.
        fit: its fit.
    """
    best, h, curve = found.candidates[0], fit.hypothesis, fit.curve
    figure, axes = single_panel(3.0)
    rows = float(found.trial_set.rows_per_block.sum())
    values = [h.value(c) for c in curve.at.tolist()]
    axes.plot(values, curve.losses.sum(axis=0) / rows, color=BEST_COLOUR, label="interpolated")
    known = [(h.value(float(p.at[0])), float(p.whitened @ p.whitened) / rows) for p in fit.comparisons]
    axes.plot(*zip(*known, strict=True), "o", color=COLOURS[0], ms=4, label="simulated")
    axes.axvline(h.value(best.at[0]), color="k", lw=1.0, ls="--", label="fitted")
    axes.set_yscale("log")
    plain_ticks(axes.yaxis)
    if h.effect.scale == "log":
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
    low, high = found.intervals(best)[0]
    axes.axvspan(low, high, color=COLOURS[4], alpha=0.35, lw=0.0, label="90 % interval")
    name = drawable(f"{h.name}: {h.effect.parameter}")
    finish(axes, f"{name} [{h.effect.unit or '1'}]", "error [1 = a right model]")
    return figure


def held_out(diagnosis: Diagnosis, found: Causes) -> Figure:
    """Draw the marker's RMS error in each trial, before and after, on data that the fit did not see."""
    best, trial_set = found.candidates[0], found.trial_set
    trials = np.unique(trial_set.sample_trials).tolist()
    figure, axes = single_panel(1.2 + 0.62 * len(trials))
    places = np.arange(len(trials))[::-1]
    looks = (
        (found.nominal.marker, 0.2, "0.35", "", "nominal"),
        (best.marker, -0.2, BEST_COLOUR, "//", drawable(f"with {best.label}")),
    )
    for apart, shift, colour, hatch, label in looks:
        left = [_rms_of(trial_set, apart, trial) for trial in trials]
        axes.barh(
            places + shift, left, height=0.36, color=colour, hatch=hatch, edgecolor="white", label=label
        )
    floors = [1e3 * marker_floor(diagnosis.trials[trial].floors) for trial in trials]
    axes.plot(floors, places, "k|", ms=22, mew=1.6, label="the floor")
    name_rows(axes, places.tolist(), [trial_set.trials[trial].aligned.trial.name for trial in trials])
    finish(axes, "RMS error of the marker, held out [mm]", "", legend=False)
    legend_below(figure, axes, 3)
    return figure


def _rms_of(trial_set: TrialSet, apart: NDArray[np.float64], trial: int) -> float:
    """Return the RMS distance of measured and simulated marker in one trial, mm."""
    axes = sum(is_position(name) for name in trial_set.trials[trial].bins.rows)
    own = apart[trial_set.sample_trials == trial]
    return float(1e3 * np.sqrt(axes * np.mean(own**2)))


def _by_phase(trial: TrialGap, name: str) -> np.ndarray:
    """Return the gap at each phase in floors; at least 0.001, so that it has a logarithm."""
    floor = trial.floors[name].total
    ratios: np.ndarray = np.maximum(trial.splits[name].by_phase / (floor or 1.0), 1e-3)
    return ratios


def _floors(trial: TrialGap, name: str, component: str) -> float:
    """Return a component's part of the length of a bar that is as long as the gap, in floors."""
    part, floor = trial.splits[name], trial.floors[name].total
    return part.squares[component] / (part.rms or 1.0) / floor if floor > 0.0 else 0.0


def gap_map(trials: Sequence[TrialGap]) -> Figure:
    """Draw the gap inside the cycle by phase, in floors: one row for each signal of each trial of a gait."""
    rows = [(trial, name) for trial in trials for name in trial.splits]
    values = np.stack([_by_phase(trial, name) for trial, name in rows])
    figure, axes = single_panel(0.28 * len(rows) + 1.2)
    image = axes.imshow(
        values,
        aspect="auto",
        cmap="viridis",
        norm=LogNorm(0.5, max(2.0, float(np.nanmax(values, initial=0.0)))),
        extent=(0.0, 1.0, len(rows) - 0.5, -0.5),
    )
    name_rows(axes, range(len(rows)), [f"{trial.name}: {name}" for trial, name in rows], 8.0)
    axes.set_xticks(np.linspace(0.0, 1.0, 5))
    axes.set_xlabel("share of the gait's cycle")
    bar = figure.colorbar(image, ax=axes, label="gap [floors]", pad=0.01)
    plain_ticks(bar.ax.yaxis)
    return figure


def _scale(name: str) -> float:
    return 1e3 if is_position(name) else float(np.rad2deg(1.0))


def _label(name: str) -> str:
    return f"{drawable(name_of(name), WIDEST_IN_LEGEND)} [mm]" if is_position(name) else "angle [°]"
