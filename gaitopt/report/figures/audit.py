"""The figure of an audit: how far its findings lie beyond their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from gaitopt.report.figures.style import COLOURS, finish, name_rows, plain_ticks, single_panel
from gaitopt.simulation.audit.finding import Finding
from gaitopt.simulation.labels import title_of

_FEW = 20.0
"""Up to so many times its limit, a linear axis shows the smaller findings too."""


def findings(found: Sequence[Finding]) -> Figure:
    """Draw by how much each finding of an audit exceeds its limit."""
    shown = [one for one in found if one.limit > 0.0 and math.isfinite(one.value) and one.value > 0.0]
    ratios = np.array([beyond(one) for one in shown])
    figure, axes = single_panel(1.2 + 0.32 * max(1, len(shown)))
    places = np.arange(len(shown))[::-1]
    if len(shown) and ratios.max() > _FEW:  # dots, as a bar on a logarithmic axis begins nowhere
        axes.plot(ratios, places, "o", color=COLOURS[0], markersize=6)
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
    else:
        axes.barh(places, ratios, color=COLOURS[0], height=0.6)
    axes.axvline(1.0, color="k", linestyle="--", linewidth=1.2, label="limit")
    labels = [title_of(one.name) + (f": {one.place}" if one.place else "") for one in shown]
    name_rows(axes, places.tolist(), labels, 8.0)
    finish(axes, "times its limit [1]", "")
    return figure


def beyond(finding: Finding) -> float:
    """Return how many times a finding exceeds its limit; of a share that is too small, limit over value."""
    value, limit = finding.value, finding.limit
    return max(value / limit, limit / value) if value > 0.0 else math.inf
