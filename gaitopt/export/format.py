"""An output format: which files it has, and the template that each comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from gaitopt.core.errors import unknown_name
from gaitopt.export.board import ESP32, ESP32_C3, ESP32_S3, Board
from gaitopt.export.gait_player import MAX_SERVOS
from gaitopt.export.output import LEDC, Output

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
        copies: further files: where each goes, and the file that it is a copy of, or its template, which ends
            in ``.jinja``.
        drives_pins: whether it sends the pulses itself, so that every servo needs a pin.
        board: the board that the servos' pins and the LED belong to.
        others: boards that ``--board`` may name in its place.
        output: what the servos are sent.
        most_servos: servos at most.
    """

    name: str
    table_file: str
    table: Path
    play: Path = INTERCHANGE
    copies: Mapping[str, Path] = field(default_factory=dict)
    drives_pins: bool = False
    board: Board = ESP32
    others: tuple[Board, ...] = ()
    output: Output = LEDC
    most_servos: int = MAX_SERVOS

    @property
    def boards(self) -> dict[str, Board]:
        """The boards that it is for, by their names in ``--board``; the first is the default."""
        return {board.name.lower(): board for board in (self.board, *self.others)}

    def on(self, board: str) -> Format:
        """Return the format for another of its boards.

        Raises:
            GaitoptError: it is not for that board.
        """
        if board not in self.boards:
            raise unknown_name(f"--board: format {self.name}", "board", board, self.boards)
        return replace(self, board=self.boards[board])


ESP32S = (ESP32_S3, ESP32_C3)
"""What may stand in place of a classic ESP32."""
