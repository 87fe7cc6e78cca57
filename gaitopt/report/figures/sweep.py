"""The figure of a sweep: the speed of a gait over one of its numbers, or of the model's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from gaitopt.optimise.sweep import Sweep, SweptPoint
from gaitopt.report.figures.style import BEST_COLOUR, COLOURS, finish, legend_below, single_panel
from gaitopt.report.letters import drawable


def speeds(sweep: Sweep, rows: Sequence[SweptPoint]) -> Figure:
    """Draw the forward speed at each value, and its interval over robots of a posterior where there are some.

    Args:
        sweep: the parameter and its values.
        rows: the result at each value.
    """
    figure, axes = single_panel(3.6)
    values, speed = np.array(sweep.values), np.array([1e3 * row.metrics["speed_m_s"] for row in rows])
    order = np.argsort(values)
    axes.plot(values[order], speed[order], color=COLOURS[0], linewidth=1.4, label="forward speed")
    met = np.array([row.constraints_met for row in rows])
    for chosen, fill, label in ((met, COLOURS[0], "limits kept"), (~met, "none", "a limit is broken")):
        if chosen.any():
            axes.plot(
                values[chosen], speed[chosen], "o", color=COLOURS[0], markerfacecolor=fill, ms=6, label=label
            )
    over = [(value, row.over_robots) for value, row in zip(sweep.values, rows, strict=True)]
    known = [(value, one.metrics["speed_m_s"]) for value, one in over if one is not None]
    if known:
        mean = np.array([one.mean for _, one in known])
        ends = np.abs(np.array([one.ci90 for _, one in known]) - mean[:, None])
        axes.errorbar(
            [value for value, _ in known], 1e3 * mean, yerr=1e3 * ends.T, fmt="D", color=BEST_COLOUR, ms=5,
            capsize=3, label="over robots of the posterior, 90 %",
        )  # fmt: skip
    finish(axes, drawable(sweep.name), "forward speed [mm/s]", legend=False)
    legend_below(figure, axes, 2)
    return figure
