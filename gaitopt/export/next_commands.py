"""The commands to play next, in a run folder: a table, and what plays it on a board or from Python."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.files import read_text
from gaitopt.diagnose.judge.command_experiment import COMMANDS_FILE, CommandExperiment
from gaitopt.export.files import environment
from gaitopt.export.format import HERE, TEMPLATES
from gaitopt.gait.command_shapes import ROW_S
from gaitopt.gait.played_commands import Cell, PlayedCommands
from gaitopt.problem.problem import Problem
from gaitopt.runs.folder import write_into

PLAYER = "next-player"
"""Folder of the player in a run folder."""


@dataclass(frozen=True)
class ChannelFacts:
    """A channel for the templates.

    Attributes:
        name: the channel.
        unit: of its cells, ``us`` or ``rad``.
        pin: GPIO of its servo; None where it is not set.
        lowest, highest: smallest and largest cell.
        from_datasheet: values of its calibration that are not set; none for a channel in rad.
    """

    name: str
    unit: str
    pin: int | None
    lowest: Cell
    highest: Cell
    from_datasheet: tuple[str, ...]


def write_next_commands(folder: Path, problem: Problem, found: CommandExperiment) -> None:
    """Write ``next.csv`` and ``next-player/`` into a run folder, each file whole or not at all.

    Raises:
        GaitoptError: a file cannot be written.
    """
    for name, text in next_command_files(problem, found).items():
        write_into(folder, name, text)


def next_command_files(problem: Problem, found: CommandExperiment) -> Mapping[str, str]:
    """Return the text of every file by its path in the run folder."""
    played = found.played
    jinja = environment()
    known = _facts(problem, found)

    def filled(template: str) -> str:
        return jinja.from_string(read_text(TEMPLATES / template)).render(known)

    return {
        COMMANDS_FILE: played.to_csv(),
        f"{PLAYER}/command_table.py": filled("command_table.py.jinja"),
        f"{PLAYER}/command_player.py": read_text(HERE / "command_player.py"),
        f"{PLAYER}/play_commands.py": read_text(TEMPLATES / "play_commands.py.txt"),
        f"{PLAYER}/README.md": filled("play_next.md.jinja"),
    }


def _facts(problem: Problem, found: CommandExperiment) -> dict[str, object]:
    played = found.played
    channels = [_channel(problem, played, index) for index in range(len(played.units))]
    head = io.StringIO()
    csv.writer(head, lineterminator="").writerow(["t_s", *played.columns])
    return {
        "about": found.chosen.words,
        "separation": found.chosen.separation.mean,
        "before": found.before,
        "separates": found.separates,
        "remarks": found.remarks,
        "unpowered": any(None in row for row in played.rows),
        "duration_s": played.commands.duration_s,
        "head": head.getvalue(),
        "channels": channels,
        "rows": [[repr(cell) for cell in row] for row in played.rows],
        "row_us": round(1e6 * ROW_S),
        "frame_us": round(1e6 * problem.file.servo.frame_s),
        "in_pulses": played.in_pulses,
        "pins_missing": any(channel.pin is None for channel in channels),
        "units": " or ".join(dict.fromkeys(played.units)),
    }


def _channel(problem: Problem, played: PlayedCommands, index: int) -> ChannelFacts:
    name, unit = played.commands.channels[index], played.units[index]
    servo = problem.file.channels[name].servo
    cells = [cell for cell in (row[index] for row in played.rows) if cell is not None]
    shown = [cell if unit == "us" else round(cell, 4) for cell in cells]
    unset = tuple(servo.from_datasheet) if unit == "us" else ()
    return ChannelFacts(name, unit, servo.pin, min(shown), max(shown), unset)
