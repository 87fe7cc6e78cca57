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
from gaitopt.diagnose.causes import Causes
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


def ranking(found: Causes) -> Figure:
    """Draw what the best rivals leave of the held-out trials, and nothing at all beside them."""
    firsts: dict[str, float] = {"no effect": float(found.none.held_out.sum())}
    errors = {"no effect": 0.0}
    best = found.rivals[0]
    for rival in found.rivals:
        if rival.label not in firsts and len(firsts) < 13:
            apart = rival.held_out - best.held_out
            firsts[rival.label] = float(rival.held_out.sum())
            errors[rival.label] = float(np.sqrt(len(apart)) * apart.std())
    rows = float(found.bench.rows_of_blocks.sum())
    names = sorted(firsts, key=lambda name: firsts[name])
    figure, axes = plt.subplots(figsize=(8.0, 0.34 * len(names) + 1.6), layout="constrained")
    places = np.arange(len(names))[::-1]
    axes.barh(
        places,
        [firsts[name] / rows for name in names],
        xerr=[errors[name] / rows for name in names],
        color=[BEST_COLOUR if name in (best.label,) else COLOURS[0] for name in names],
    )
    axes.set_yticks(places, names, fontsize=8)
    axes.set_xscale("log")
    axes.axvline(1.0, color="k", lw=1.0, ls="--", label="a right model")
    finish(axes, "whitened mean square left on held-out data; error bars: of the difference to the first", "")
    return figure


def profile(found: Causes) -> Figure:
    """Draw the loss along each parameter of the winner, and the sets simulated."""
    best = found.rivals[0]
    figure, grid = plt.subplots(
        1, len(best.fits), figsize=(5.5 * len(best.fits), 3.2), layout="constrained", squeeze=False
    )
    rows = float(found.bench.rows_of_blocks.sum())
    for axes, fit, at in zip(grid[0], best.fits, best.at, strict=True):
        h, curve = fit.hypothesis, fit.curve
        values = [h.value(c) for c in curve.at.tolist()]
        axes.plot(values, curve.losses.sum(axis=0) / rows, color=BEST_COLOUR, label="between them")
        known = [(h.value(float(p.at[0])), float(p.whitened @ p.whitened) / rows) for p in fit.points]
        axes.plot(*zip(*known, strict=True), "o", color=COLOURS[0], ms=4, label="simulated")
        axes.axvline(h.value(at), color="k", lw=1.0, ls="--", label="fitted")
        axes.set_yscale("log")
        finish(axes, f"{h.name}: {h.effect.parameter}", "whitened mean square")
    return figure


def corrected(found: Causes) -> Figure:
    """Draw the marker's residual of every sample of each trial, before and after, held out."""
    best, bench = found.rivals[0], found.bench
    trials = np.unique(bench.sample_trials).tolist()
    figure, grid = plt.subplots(
        max(1, len(trials)),
        1,
        figsize=(8.0, 1.7 * max(1, len(trials)) + 0.6),
        layout="constrained",
        squeeze=False,
    )
    for axes, trial in zip(grid[:, 0], trials, strict=False):
        own = bench.sample_trials == trial
        axes.plot(1e3 * found.nominal.apart[own], ".", ms=2, color=COLOURS[0], label="nominal")
        axes.plot(1e3 * best.apart[own], ".", ms=2, color=BEST_COLOUR, label=best.label)
        axes.set_title(bench.views[trial].aligned.trial.name, loc="left", fontsize=10)
        finish(axes, "sample, axis after axis", "apart [mm]", legend=trial == trials[0])
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
