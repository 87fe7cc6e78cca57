"""Figure of a campaign: speeds predicted and measured, film by film."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gaitopt.campaign.records import Proposal, Step
from gaitopt.report.figures.style import BEST_COLOUR, COLOURS, MARKS, finish, legend_below, single_panel
from gaitopt.report.letters import WIDEST_IN_LEGEND, drawable
from gaitopt.runs.campaign_folder import Rival


def speeds(proposals: Sequence[Proposal], steps: Sequence[Step], rivals: Sequence[Rival]) -> Figure:
    """Draw what was predicted of each film, what it measured, and the best speed so far."""
    figure, axes = single_panel(4.0)
    numbers = [one.film for one in proposals]
    means = [1e3 * one.predicted_speed_m_s.mean for one in proposals]
    below = [1e3 * (one.predicted_speed_m_s.mean - one.predicted_speed_m_s.ci90[0]) for one in proposals]
    above = [1e3 * (one.predicted_speed_m_s.ci90[1] - one.predicted_speed_m_s.mean) for one in proposals]
    errors = [[max(0.0, end) for end in ends] for ends in (below, above)]
    axes.errorbar(
        numbers,
        means,
        yerr=errors,
        fmt="o",
        mfc="none",
        color=COLOURS[0],
        capsize=3.0,
        label="predicted before the film, 90 % interval",
    )
    measured = {film: 1e3 * speed for film, speed in steps[-1].measured.items()}
    if measured:
        axes.plot(
            list(measured), list(measured.values()), "*", color=BEST_COLOUR, markersize=11.0, label="measured"
        )
        so_far = [max(speed for film, speed in measured.items() if film <= last) for last in sorted(measured)]
        axes.step(
            sorted(measured), so_far, where="post", color=BEST_COLOUR, linewidth=1.0, label="best so far"
        )
    for index, rival in enumerate(rivals):
        best = [1e3 * max(rival.measured_speeds_m_s[: n + 1]) for n in range(len(rival.measured_speeds_m_s))]
        axes.plot(
            range(1, len(best) + 1),
            best,
            MARKS[index % len(MARKS)] + ":",
            color=COLOURS[(index + 1) % len(COLOURS)],
            markersize=4.0,
            linewidth=1.0,
            label=drawable(f"{rival.name}, best so far", WIDEST_IN_LEGEND),
        )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    finish(axes, "film", "forward speed [mm/s]", legend=False)
    legend_below(figure, axes, 2)
    return figure
