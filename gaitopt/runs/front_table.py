"""``pareto.csv``: the gaits of speed against cost of transport, each with its numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from gaitopt.optimise.journal import gait_columns
from gaitopt.optimise.pareto import FrontGait
from gaitopt.problem.problem import Problem
from gaitopt.runs.summary import FrontRow


def front_csv(problem: Problem, front: Sequence[FrontGait]) -> str:
    """Return the gaits of a front as a CSV table: a row of the summary and the gait's numbers each."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*FrontRow.model_fields, "period_s", *gait_columns(problem)])
    for found in front:
        gait = found.verified.gait
        shape = [value for channel in gait.channels.values() for value in channel.model_dump().values()]
        row = [*FrontRow.of(found).model_dump().values(), gait.period_s, *shape]
        table.writerow([str(cell).lower() if isinstance(cell, bool) else str(cell) for cell in row])
    return text.getvalue()
