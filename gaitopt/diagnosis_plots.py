"""Figures of a diagnosis: measured against simulated, where in the cycle, and which component."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from gaitopt.diagnose.align import is_marker
from gaitopt.diagnose.diagnosis import Diagnosis, TrialGap
from gaitopt.diagnose.where import COMPONENTS, PHASE_BINS
from gaitopt.plots import BEST_COLOUR, COLOURS, finish

_MASKED_COLOUR = "0.35"
_HATCHES = ("", "//", "..", "xx", "\\\\")


def measured_and_simulated(diagnosis: Diagnosis) -> Figure:
    """Draw every measured signal over its prediction, samples that do not count marked."""
    signals = list(dict.fromkeys(name for trial in diagnosis.trials for name in trial.splits))
    rows, columns = len(signals), len(diagnosis.trials)
    figure, grid = plt.subplots(
        rows,
        columns,
        figsize=(max(8.0, 4.2 * columns), 2.9 * rows + 0.6),
        layout="constrained",
        squeeze=False,
    )
    for column, trial in enumerate(diagnosis.trials):
        for row, name in enumerate(signals):
            axes = grid[row, column]
            if name not in trial.splits:
                axes.set_axis_off()
                continue
            _signal(axes, trial, name)
            axes.set_title(f"{trial.name}: {name}", loc="left", fontsize=10)
            finish(axes, "gait time [s]", _label(name), legend=row == 0 and column == 0)
    return figure


def _signal(axes: Axes, trial: TrialGap, name: str) -> None:
    """Draw one signal; the recording as it was made, so that corrected time stamps show."""
    aligned, recorded = trial.aligned, trial.cleaned.recorded
    scale, origin = _scale(name), float(np.nanmin(aligned.predicted[name]))
    used = aligned.trial.used[name]
    corrected = recorded.time != aligned.trial.time
    measured = scale * (aligned.trial.signals[name] - origin)
    axes.plot(
        aligned.time, scale * (aligned.predicted[name] - origin), color=BEST_COLOUR, lw=1.3, label="simulated"
    )
    axes.plot(aligned.time[used], measured[used], ".", color=COLOURS[0], ms=2.5, label="measured")
    masked = ~used & np.isfinite(measured)
    axes.plot(aligned.time[masked], measured[masked], "x", color=_MASKED_COLOUR, ms=4, mew=0.8)
    axes.plot([], [], "x", color=_MASKED_COLOUR, ms=4, mew=0.8, label="masked")
    if corrected.any():
        raw = recorded.time[corrected] + aligned.offset_s
        axes.plot(raw, measured[corrected], "|", color=COLOURS[3], ms=4, mew=0.7, label="stamp corrected")


def components(diagnosis: Diagnosis) -> Figure:
    """Draw the components of the gap of each signal and trial, in floors."""
    bars = [(trial, name) for trial in diagnosis.trials for name in trial.splits]
    figure, axes = plt.subplots(figsize=(8.0, 0.42 * len(bars) + 1.6), layout="constrained")
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
    labels = [f"{trial.name}: {name}{'' if trial.counts else ' (not used)'}" for trial, name in bars]
    axes.set_yticks(places, labels, fontsize=8)
    axes.set_axisbelow(True)
    axes.axvline(1.0, color="k", lw=1.0, ls="--", label="the floor")
    finish(axes, "gap [floors]; a component's length is its share of the squared gap", "")
    return figure


def _by_phase(trial: TrialGap, name: str) -> np.ndarray:
    """Return the gap at each phase in floors, at least a little so that it has a logarithm."""
    floor = trial.floors[name].total
    ratios: np.ndarray = np.maximum(trial.splits[name].by_phase / (floor or 1.0), 1e-3)
    return ratios


def _floors(trial: TrialGap, name: str, component: str) -> float:
    """Return a component's part of the length of a bar that is as long as the gap, in floors."""
    part, floor = trial.splits[name], trial.floors[name].total
    return part.squares[component] / (part.rms or 1.0) / floor if floor > 0.0 else 0.0


def gap_map(diagnosis: Diagnosis) -> Figure:
    """Draw the gap inside the cycle by phase, in floors: one row for each signal of each trial."""
    rows = [(trial, name) for trial in diagnosis.trials for name in trial.splits]
    values = np.stack([_by_phase(trial, name) for trial, name in rows])
    figure, axes = plt.subplots(figsize=(8.0, 0.36 * len(rows) + 1.6), layout="constrained")
    image = axes.imshow(
        values,
        aspect="auto",
        cmap="viridis",
        norm=LogNorm(0.5, max(2.0, float(np.nanmax(values, initial=0.0)))),
        extent=(0.0, 1.0, len(rows) - 0.5, -0.5),
    )
    axes.set_yticks(range(len(rows)), [f"{trial.name}: {name}" for trial, name in rows], fontsize=8)
    axes.set_xticks(np.linspace(0.0, 1.0, PHASE_BINS // 3 + 1))
    axes.set_xlabel("share of the gait's cycle")
    figure.colorbar(image, ax=axes, label="gap [floors]", pad=0.01)
    return figure


def _scale(name: str) -> float:
    return 1e3 if is_marker(name) else float(np.rad2deg(1.0))


def _label(name: str) -> str:
    return f"{name.partition('.')[2]} [mm]" if is_marker(name) else "angle [°]"
