"""The part of a diagnosis' page on the commands to play next: a plot, and a table with the runners-up."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

from gaitopt.core.quantities import figure
from gaitopt.diagnose.judge.command_experiment import COMMANDS_FILE, CommandExperiment, ScoredCommands
from gaitopt.report.figures import gait as gait_plots
from gaitopt.report.page import Picture, Section, Table, save_figures


def next_commands_sections(folder: Path, found: CommandExperiment) -> list[Section]:
    """Return what a page says of the commands to play next; their plot goes into ``figures/``.

    Raises:
        GaitoptError: the figure cannot be written.
    """
    picture = Picture(
        "What to play next",
        partial(gait_plots.logged, found.played.commands),
        f"The commands in {COMMANDS_FILE}. {what_they_tell(found)} Play them (next-player/), add the "
        "recording to the data set, and diagnose again.",
    )
    section = Section("The next commands", sentences=found.remarks, table=_table(found))
    return [*save_figures(folder, {"next": picture}), section]


def what_they_tell(found: CommandExperiment) -> str:
    """Return what the commands are expected to tell, in a sentence or two."""
    apart = f"by {figure(found.chosen.separation.mean)} floors on average"
    so_far = f"; the best commands so far: {figure(found.before)}" if found.before else ""
    if len(found.separates) == 1:
        only = found.separates[0]
        return f"They set robots that all have {only} apart {apart}{so_far}, and narrow its figures."
    text = f"They set {', '.join(found.separates)} apart {apart}{so_far}."
    pairs = "; ".join(" and ".join(pair) for pair in found.inseparable)
    return text + (f" No commands tell these apart: {pairs}." if pairs else "")


def _table(found: CommandExperiment) -> Table:
    return Table(
        head=["shape", "channel", "amplitude [°]", "length [s]", "separation [floors]", "doubt left"],
        rows=[_row(one) for one in (found.chosen, *found.runners_up)],
        note="Separation: mean distance of two explanations, weighted by their probabilities. Doubt left: "
        "expected probability of a wrong explanation after a recording. The first row was chosen.",
        mark_first=True,
    )


def _row(one: ScoredCommands) -> list[str]:
    return [
        one.made.shape.name,
        one.made.channel,
        figure(math.degrees(one.made.amplitude_rad)),
        figure(one.played.commands.duration_s),
        figure(one.separation.mean),
        f"{100.0 * one.separation.doubt:.2g} %",
    ]
