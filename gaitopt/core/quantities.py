"""Quantities as readers see them: a unit and three significant digits."""

from __future__ import annotations

import math
from collections.abc import Mapping

_UNITS: Mapping[str, tuple[str, float]] = {
    "_rad_s": ("°/s", math.degrees(1.0)),
    "_m_s": ("mm/s", 1e3),
    "_n_m": ("N m", 1.0),
    "_rad": ("°", math.degrees(1.0)),
    "_deg": ("°", 1.0),
    "_m": ("mm", 1e3),
    "_w": ("mW", 1e3),
    "_s": ("s", 1.0),
}
"""Suffix of a name: the unit shown and the factor to it. Longer suffixes come first."""


def unit_of(name: str) -> tuple[str, float]:
    """Return the unit in which a figure of this name is shown, and the factor to it."""
    return _UNITS.get(_suffix(name), ("", 1.0))


def stem_of(name: str) -> str:
    """Return a name without its unit: ``speed`` of ``speed_m_s``."""
    return name.removesuffix(_suffix(name))


def figure(value: float) -> str:
    """Return a number with three significant digits, without an exponent if possible."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0.0 else "-∞"
    if abs(value) >= 1e5 or 0.0 < abs(value) < 5e-4:
        return f"{value:.1e}"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _suffix(name: str) -> str:
    return next((suffix for suffix in _UNITS if name.endswith(suffix)), "")
