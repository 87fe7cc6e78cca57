"""An output format: which files it has, and the template that each comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gaitopt.export.board import ESP32, Board

HERE = Path(__file__).parent
TEMPLATES = HERE / "templates"
"""Templates and sources of the formats here; a format may have its own elsewhere."""

INTERCHANGE = TEMPLATES / "play_table.md.jinja"
"""How to play a table for other programs."""


@dataclass(frozen=True)
class Format:
    """One output format. A new one is a record, its templates and one entry in `FORMATS`.

    Templates are Jinja's. They see the fields of `files.TableFacts` and the filters ``comment`` and ``cell``.

    Attributes:
        name: what the command line calls it.
        table_file: where the file goes that holds the table and the gait.
        table: template of that file.
        play: template of the README's section on how to play it.
        copies: further files: where each goes, and the file that it is a copy of.
        drives_pins: whether it sends the pulses itself, so that every servo needs a pin.
        board: the board that the servos' pins belong to.
    """

    name: str
    table_file: str
    table: Path
    play: Path = INTERCHANGE
    copies: Mapping[str, Path] = field(default_factory=dict)
    drives_pins: bool = False
    board: Board = ESP32
