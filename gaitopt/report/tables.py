"""Tables that several pages have."""

from __future__ import annotations

from collections.abc import Sequence

from gaitopt.core.quantities import figure
from gaitopt.gait.gait import Gait
from gaitopt.optimise.compare import ComparedGait
from gaitopt.report.page import Table
from gaitopt.runs.summary import GaitRow
from gaitopt.simulation.labels import label_of, shown


def metric_table(rows: Sequence[GaitRow | ComparedGait]) -> Table:
    """Return every metric of some gaits, a column each."""
    return Table(
        head=["metric", *(row.name for row in rows)],
        rows=[
            [label_of(name), *(shown(name, row.metrics[name]) for row in rows)] for name in rows[0].metrics
        ],
        note="Means over the same scenarios; for drifts, the mean size. ∞: a square wave commands a step.",
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
