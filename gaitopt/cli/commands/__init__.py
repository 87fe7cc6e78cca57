"""The commands, one a file: options and printing; the work is done by `gaitopt.jobs`."""

from __future__ import annotations

from collections.abc import Sequence

from gaitopt.cli.command import Command
from gaitopt.cli.commands import (
    blind,
    campaign,
    check,
    command,
    compare,
    completion,
    correct,
    demo,
    diagnose,
    effects,
    export,
    film,
    imports,
    model,
    new,
    optimise,
    plan,
    runs,
    simulate,
    sweep,
    tags,
    track,
    watch,
)

COMMANDS: Sequence[Command] = (
    optimise.COMMAND,
    runs.COMMAND,
    watch.COMMAND,
    plan.COMMAND,
    simulate.COMMAND,
    sweep.COMMAND,
    compare.COMMAND,
    check.COMMAND,
    effects.COMMAND,
    model.COMMAND,
    command.COMMAND,
    diagnose.COMMAND,
    correct.COMMAND,
    blind.COMMAND,
    campaign.COMMAND,
    imports.COMMAND,
    tags.COMMAND,
    film.COMMAND,
    track.COMMAND,
    export.COMMAND,
    new.COMMAND,
    demo.COMMAND,
    completion.COMMAND,
)
"""Every command in the order of the help."""
