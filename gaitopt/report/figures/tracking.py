"""Figures of tracked films: each signal over time, with its gaps."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gaitopt.core.quantities import figure, unit_of
from gaitopt.diagnose.record.defect import runs
from gaitopt.report.figures.style import BEST_COLOUR, COLOURS, stacked_panels
from gaitopt.report.letters import drawable
from gaitopt.robot.signals import is_position
from gaitopt.track.found import FilmTrack
from gaitopt.track.untagged import PointTrack

_PANEL = 0.85
"""Height of a panel, inches."""


def tracks(found: FilmTrack | PointTrack) -> Figure:
    """Draw the signals of a film over one another, each about its mean; gaps are shaded."""
    drawn, panels = stacked_panels(len(found.signals), 0.5 + _PANEL * len(found.signals))
    for axes, (name, series) in zip(panels, found.signals.items(), strict=True):
        unit, factor = unit_of("_m" if is_position(name) else "_rad")
        shown = factor * (series - np.nanmean(series))
        axes.plot(found.time, shown, ".-", color=COLOURS[0], lw=0.8, ms=2.0)
        for begin, end in runs(~np.isfinite(series)):
            left, right = found.time[max(begin - 1, 0)], found.time[min(end, len(series) - 1)]
            axes.axvspan(left, right, color=BEST_COLOUR, alpha=0.25, lw=0.0)
        noise = f"± {figure(factor * found.noise[name])} {unit}"
        axes.set_title(f"{drawable(name)}, noise {noise}", fontsize=8, loc="left", pad=2.0)
        axes.set_ylabel(unit, fontsize=8)
        axes.tick_params(labelsize=8)
        axes.locator_params(axis="y", nbins=4)
    panels[-1].set_xlabel("time in the film [s]")
    return drawn
