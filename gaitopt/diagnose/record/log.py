"""A log: columns of numbers with a time stamp a row, and the motion and the commands in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.columns import Chosen, chosen_columns
from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import VIEWS, ImportOptions, Motion, Sent
from gaitopt.diagnose.record.log_rows import LogRows
from gaitopt.diagnose.record.log_time import forward_clock, log_seconds
from gaitopt.diagnose.record.log_units import LogUnits
from gaitopt.diagnose.record.tables import MOST_CELLS
from gaitopt.diagnose.record.trial import Flags, Series
from gaitopt.robot.signals import MARKER, is_position, marker_signal

_SHOWN = 20
"""Columns that a message lists."""


@dataclass(frozen=True)
class Log:
    """What a log holds, in its own units.

    Attributes:
        path: the file or folder.
        name: what the trial is to be called.
        time_column: name of the time stamps.
        stamps: the time stamps, shape (n,).
        lines: line of each row in the file, shape (n,).
        head: names of the other columns.
        column: returns the numbers of a column, NaN where there is none, shape (n,).
        mentioned: returns the rows that mention a column, shape (n,); None where a blank cell is a command,
            too: that of an unpowered servo.
    """

    path: Path
    name: str
    time_column: str
    stamps: Series
    lines: NDArray[np.int64]
    head: Sequence[str]
    column: Callable[[str], Series]
    mentioned: Callable[[str], Flags] | None = None

    def motion(self, options: ImportOptions) -> Motion:
        """Return the motion in the log, and the commands where it holds some.

        Args:
            options: what the log does not say itself.

        Raises:
            GaitoptError: a column, unit or time stamp is missing or wrong, or nothing was measured.
        """
        chosen = chosen_columns(self.path, self.head, options.commands, options.signals)
        chosen, turned = self._seen_from(chosen, options)
        self._check_size(chosen)
        time, zero_s, defects = self._clock(chosen, options)
        units = LogUnits(self.path, options)
        signals = {n: units.signal(n, c, self.column(c.name)) for n, c in chosen.signals.items()}
        commands = dict(units.command(n, c, self.column(c.name)) for n, c in chosen.commands.items())
        rows, late = self._rows(chosen, signals, commands).begun(self.path, self.name, time)
        seen = {name: series[rows.seen] for name, series in signals.items()}
        defects += [*turned, *([late] if late else [])]
        if not commands:
            return Motion(time[rows.seen], seen, defects, self.name, None, zero_s)
        last = rows.sent(time)
        held = {name: rows.held(name, series)[last] for name, series in commands.items()}
        return Motion(time[rows.seen], seen, defects, self.name, Sent(time[last], held), zero_s)

    def _seen_from(self, chosen: Chosen, options: ImportOptions) -> tuple[Chosen, list[Defect]]:
        """Return the columns with ``y`` as the height, where it is the picture's second axis, and a note."""
        across, up = VIEWS[options.view]
        second = marker_signal("y")
        axes = [name for name in chosen.signals if name in MARKER]
        named = chosen.signals.get(second)
        if axes != [across, second] or up == second or second in options.signals or named is None:
            return chosen, []
        if named.name.startswith(second):
            return chosen, []
        signals = {up if name == second else name: column for name, column in chosen.signals.items()}
        message = (
            f"{named.name} is taken for the height, as in a picture from the side; from above: --view top"
        )
        return Chosen(chosen.commands, signals), [Defect("side_view", self.name, message)]

    def _check_size(self, chosen: Chosen) -> None:
        """Check that something was measured, and that not too much was."""
        if not chosen.signals:
            names = [self.time_column, *self.head]
            listed = ", ".join([*names[:_SHOWN], *(["…"] if len(names) > _SHOWN else [])])
            raise GaitoptError(f"{self.path}: no column such as x_m or mid_left_rad; it has {listed}")
        cells = (len(chosen.signals) + len(chosen.commands)) * len(self.stamps)
        if cells > MOST_CELLS:
            raise GaitoptError(f"{self.path}: found {cells} numbers; allowed: at most {MOST_CELLS}")

    def _clock(self, chosen: Chosen, options: ImportOptions) -> tuple[Series, float, list[Defect]]:
        """Return time stamps, s, the stamp that is their zero, s, and what was wrong with them.

        They do not go backward, but for films: there it is an error.
        """
        missing = int(np.isnan(self.stamps).sum())
        if missing:
            raise GaitoptError(f"{self.path}: {missing} time stamps are missing")
        time, zero_s = log_seconds(self.path, self.time_column, self.stamps, options.time_unit)
        defects = []
        if zero_s:
            message = f"time stamps count from 1970: the first of them, {zero_s:.3f} s, is taken for zero"
            defects.append(Defect("clock_zero", self.name, message, parameters={"zero_s": zero_s}))
        if not any(map(is_position, chosen.signals)):
            time, back = forward_clock(self.path, self.name, time, self.lines)
            defects += [back] if back else []
        return time, zero_s, defects

    def _rows(self, chosen: Chosen, signals: dict[str, Series], commands: dict[str, Series]) -> LogRows:
        if self.mentioned is None:
            return LogRows.by_blanks(signals, commands)
        flags = [self.mentioned(column.name) for column in chosen.signals.values()]
        columns = [column.name for column in chosen.commands.values()]
        told = {n: self.mentioned(column) for n, column in zip(commands, columns, strict=True)}
        return LogRows(np.logical_or.reduce(flags), told)
