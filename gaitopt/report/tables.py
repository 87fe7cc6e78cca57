"""Tables that several pages have."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from gaitopt.core.quantities import figure
from gaitopt.gait.gait import Gait
from gaitopt.optimise.compare import ComparedGait
from gaitopt.report.page import Table
from gaitopt.runs.summary import BestRow, GaitRow
from gaitopt.simulation.labels import label_of, shown, title_of, with_unit


def metric_table(rows: Sequence[GaitRow | ComparedGait]) -> Table:
    """Return every metric of some gaits, a column each."""
    return Table(
        head=["metric", *(row.name for row in rows)],
        rows=[
            [label_of(name), *(shown(name, row.metrics[name]) for row in rows)] for name in rows[0].metrics
        ],
        note="Means over the same scenarios; for drifts, the mean size. ∞: a square wave commands a step.",
    )


MARGIN_HEAD = ("limit on", "allowed", "value", "worst", "margin", "broken in")
"""Head of the table of margins, on the page and in the terminal."""


def margin_rows(best: BestRow) -> list[list[str]]:
    """Return every limit of the objective with what the winner leaves of it, the closest first."""
    return [
        [
            title_of(row.constraint),
            row.allowed,
            with_unit(row.constraint, row.value),
            with_unit(row.constraint, row.worst),
            "–" if isnan(row.margin) else f"{100.0 * row.margin:.3g} %",
            f"{len(row.broken_in)} of {row.scenarios}",
        ]
        for row in sorted(best.margins, key=lambda row: row.margin)
    ]


def margin_table(best: BestRow) -> Table:
    """Return the table of margins of a page."""
    return Table(
        head=MARGIN_HEAD,
        rows=margin_rows(best),
        note="Value: the mean over the scenarios, or as the problem judges its limits. Worst: the scenario "
        "closest to the limit. Margin: what the value leaves of the limit, as a share of it. Broken in: "
        "how many scenarios break the limit.",
    )


def gait_table(gait: Gait, file: str) -> Table:
    """Return a gait's numbers, rounded.

    Args:
        gait: the gait.
        file: the file that has every digit.
    """
    return Table(
        head=["servo", "duty [%]", "phase [cycles]", "from [°]", "to [°]", "smoothing"],
        rows=[
            [
                name,
                f"{100 * channel.duty:.1f}",
                f"{channel.phase:.3f}",
                f"{channel.offset_deg:.1f}",
                f"{channel.offset_deg + channel.amplitude_deg:.1f}",
                f"{channel.smoothing:.2f}",
            ]
            for name, channel in gait.channels.items()
        ],
        note=f"Period {figure(gait.period_s)} s. In each cycle a servo is at the second angle for the share "
        "that its duty says, and at the first angle for the rest. Smoothing 0 is a square wave. "
        f"{file} has every digit.",
    )
