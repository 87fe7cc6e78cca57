"""The part of a diagnosis' page on the commands to play next: a plot, and a table with the runners-up."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

from gaitopt.core.quantities import figure
from gaitopt.diagnose.judge.command_experiment import COMMANDS_FILE, CommandExperiment
from gaitopt.diagnose.judge.command_search import ScoredCommands
from gaitopt.diagnose.next_words import what_commands_tell
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
        f"The commands in {COMMANDS_FILE}. {what_commands_tell(found)} Play them (next-player/), add the "
        "recording to the data set, and diagnose again.",
    )
    section = Section("The next commands", sentences=found.remarks, table=_table(found))
    return [*save_figures(folder, {"next": picture}), section]


def _table(found: CommandExperiment) -> Table:
    return Table(
        head=[
            "shape",
            "channel",
            "amplitude [°]",
            "length [s]",
            "separation [times the uncertainty]",
            "doubt left",
        ],
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
