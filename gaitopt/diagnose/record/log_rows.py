"""Rows of a log: which of them measured something, and which of them commanded something."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.defect import Defect, counted
from gaitopt.diagnose.record.trial import Flags, Series


@dataclass(frozen=True)
class LogRows:
    """Which rows of a log say what.

    Attributes:
        seen: those that measured something, shape (n,).
        told: those that command a channel, by channel, each of shape (n,).
    """

    seen: Flags
    told: Mapping[str, Flags]

    @staticmethod
    def by_blanks(signals: Mapping[str, Series], commands: Mapping[str, Series]) -> LogRows:
        """Return the rows of a table, in which a blank command means an unpowered servo.

        If no row has both a command and a measured value, a blank cell says nothing: the table holds rows of
        two kinds.

        Args:
            signals: numbers by signal, NaN where a cell is blank, each of shape (n,).
            commands: the same by channel.
        """
        seen = np.logical_or.reduce([np.isfinite(series) for series in signals.values()])
        told = {channel: np.isfinite(series) for channel, series in commands.items()}
        some = np.logical_or.reduce([*told.values(), np.zeros_like(seen)])
        if not told or (seen & some).any() or not seen.any() or not some.any():
            every = np.ones_like(seen)
            return LogRows(every, dict.fromkeys(told, every))
        return LogRows(seen, told)

    def begun(self, source: object, name: str, time: Series) -> tuple[LogRows, Defect | None]:
        """Return the rows without those before each channel has a command.

        Args:
            source: the log, for messages.
            name: name of the trial.
            time: time stamps, s, shape (n,).

        Raises:
            GaitoptError: a channel has no command at all.
        """
        silent = next((channel for channel, flags in self.told.items() if not flags.any()), None)
        if silent is not None:
            raise GaitoptError(f"{source}: no command of {silent} in any row")
        begin = max((int(flags.argmax()) for flags in self.told.values()), default=0)
        late = self.seen & (np.arange(len(time)) < begin)
        if not late.any():
            return self, None
        message = (
            f"{counted(int(late.sum()), 'sample')} before t = {time[begin]:.2f} s left out: not every "
            "channel has a command there"
        )
        return LogRows(self.seen & ~late, self.told), Defect("late_commands", name, message, int(late.sum()))

    def sent(self, time: Series) -> NDArray[np.intp]:
        """Return the rows of the log of commands, shape (m,): of several at one time the last."""
        begin = max(int(flags.argmax()) for flags in self.told.values())
        rows = np.flatnonzero(np.logical_or.reduce(list(self.told.values())))
        rows = rows[rows >= begin]
        last: NDArray[np.intp] = rows[np.append(np.diff(time[rows]) > 0.0, True)]
        return last

    def held(self, channel: str, series: Series) -> Series:
        """Return what each row holds for a channel: its own command, or the last one before, shape (n,).

        Args:
            channel: the channel.
            series: its commands, shape (n,); NaN in a row that commands it: unpowered.
        """
        last = np.maximum.accumulate(np.where(self.told[channel], np.arange(len(series)), 0))
        held: Series = series[last]
        return held
