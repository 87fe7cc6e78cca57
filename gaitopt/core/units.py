"""Units of the columns of files: the suffix of a column's name gives its unit. All else is in SI."""

from __future__ import annotations

import math
from collections.abc import Mapping

from gaitopt.core.errors import bad_value

TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLE = {"rad": 1.0, "deg": math.pi / 180.0}


def suffix_scale(source: object, key: str, column: str, units: Mapping[str, float]) -> float:
    """Return the factor from a column's numbers to SI, from the suffix of its name.

    Args:
        source: the file that names the column.
        key: the key in that file.
        column: the column's name, such as ``x_mm``.
        units: the units allowed, `TIME`, `LENGTH` or `ANGLE`.

    Raises:
        GaitoptError: the suffix is not one of the units.
    """
    stem, _, unit = column.rpartition("_")
    if not stem or unit not in units:
        allowed = "a column whose name ends in its unit, " + ", ".join(f"_{name}" for name in units)
        hint = "; pixels need a scale: gaitopt import --scale-m-per-px" if unit in ("px", "pixel") else ""
        raise bad_value(source, key, column, allowed + hint)
    return units[unit]
