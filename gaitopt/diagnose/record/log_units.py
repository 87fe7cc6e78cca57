"""Units of the columns of logs: from the column's name or an option to radians and metres."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.units import ANGLE, LENGTH
from gaitopt.diagnose.record.columns import COUNTS, PULSE, Column
from gaitopt.diagnose.record.export import NORMALISED, ImportOptions
from gaitopt.diagnose.record.trial import Series
from gaitopt.robot.signals import is_position, name_of

_ANGLES = (*ANGLE, COUNTS, NORMALISED)

_LONGEST_PULSE_US = 20_000.0
"""No servo takes a longer pulse, µs: at 50 Hz it would not end before the next one."""


@dataclass(frozen=True)
class LogUnits:
    """How the numbers of a log become SI units.

    Attributes:
        path: the log, for messages.
        options: the units of columns whose names have none.
    """

    path: Path
    options: ImportOptions

    def signal(self, signal: str, column: Column, numbers: Series) -> Series:
        """Return a measured signal, rad or m, shape (n,).

        Args:
            signal: its name.
            column: where it stands.
            numbers: as they are logged, shape (n,).

        Raises:
            GaitoptError: the unit is missing, or is none of this kind of signal.
        """
        if is_position(signal):
            unit = self._known(column, column.unit or self.options.length_unit, "--length-unit", LENGTH)
            return numbers * LENGTH[unit]
        unit = self._known(column, column.unit or self.options.angle_unit, "--angle-unit", _ANGLES)
        return self._angles(column, unit, name_of(signal), numbers)

    def command(self, channel: str, column: Column, numbers: Series) -> tuple[str, Series]:
        """Return the column of a channel in a data set, ``NAME_rad`` or ``NAME_us``, and its numbers.

        Args:
            channel: its name.
            column: where it stands.
            numbers: as they are logged, shape (n,).

        Raises:
            GaitoptError: the unit is missing, or is none of a command.
        """
        allowed = (*_ANGLES, PULSE)
        unit = self._known(column, column.unit or self.options.angle_unit, "--angle-unit", allowed)
        if unit != PULSE:
            return f"{channel}_rad", self._angles(column, unit, channel, numbers)
        outside = numbers[(numbers < 0.0) | (numbers > _LONGEST_PULSE_US)]
        if len(outside):
            raise GaitoptError(
                f"{self.path}: {column.name}: found {outside[0]:g}; allowed: pulse widths from 0 to "
                f"{_LONGEST_PULSE_US:g} µs"
            )
        return f"{channel}_{PULSE}", numbers

    def _angles(self, column: Column, unit: str, owner: str, numbers: Series) -> Series:
        """Return angles, rad, shape (n,)."""
        if unit == COUNTS:
            per_turn = self.options.counts_per_turn
            return (numbers - 0.5 * per_turn) * (2.0 * math.pi / per_turn)
        if unit == NORMALISED:
            return numbers * (math.radians(self._full_scale(column, owner)) / 100.0)
        return numbers * ANGLE[unit]

    def _full_scale(self, column: Column, owner: str) -> float:
        """Return the angle that is logged as 100, degrees."""
        scales = self.options.full_scale_deg
        scale = scales.get(owner, scales.get(""))
        if scale is None:
            raise GaitoptError(
                f"{self.path}: {column.name}: normalised, of an unknown range; say which angle is 100: "
                f"--full-scale-deg DEG, or --full-scale-deg {owner}=DEG"
            )
        return scale

    def _known(self, column: Column, unit: str | None, option: str, allowed: Iterable[str]) -> str:
        if unit is None:
            units = list(allowed)
            raise GaitoptError(
                f"{self.path}: {column.name}: its unit is not known; say it: {option} {', '.join(units)}; "
                f"for example, add {option} {'mm' if 'mm' in units else 'deg'}"
            )
        if unit not in allowed:
            raise bad_value(self.path, column.name, unit, f"the unit {', '.join(allowed)}", allowed)
        return unit
