"""Quantities as people read them: a name, a unit and three significant digits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

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
"""Suffix of a metric's name: the unit shown and the factor to it. Longer suffixes come first."""

_SHARES = ("airtime", "reached")

_NAMES: Mapping[str, str] = {
    "name": "gait",
    "speed": "forward speed",
    "speed_ci90": "90 % interval of the speed",
    "speed_worst": "speed in the worst scenario",
    "difference": "difference to the first",
    "difference_ci90": "90 % interval of the difference",
    "ratio": "ratio to the first",
    "ratio_ci90": "90 % interval of the ratio",
    "sideways": "sideways speed",
    "sideways_ratio": "sideways over forward",
    "yaw_rate": "turning rate",
    "tilt": "largest tilt",
    "slip": "slip back per cycle",
    "airtime": "time in the air",
    "penetration": "deepest penetration",
    "peak_torque": "peak torque",
    "rms_torque": "RMS torque",
    "power": "mechanical power",
    "command_speed_ratio": "command over no-load speed",
    "reached": "travel reached",
}


def title_of(name: str) -> str:
    """Return the title of a metric without its unit: "forward speed" for ``speed_m_s``."""
    stem, _, part = name.removesuffix(_suffix(name)).partition(".")
    return _NAMES.get(stem, stem.replace("_", " ")) + (f", {part}" if part else "")


def label_of(name: str) -> str:
    """Return the title of a metric with the unit in which `shown` gives it."""
    unit, _ = _unit(name)
    return f"{title_of(name)} [{unit}]" if unit else title_of(name)


def shown(name: str, value: object) -> str:
    """Return a metric's value in the unit of its label; None and NaN are a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return figure(value * _unit(name)[1])
    if isinstance(value, Mapping):
        return ", ".join(title_of(key) for key in value) or "none"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " to ".join(shown(name, item) for item in value)
    return str(value)


def figure(value: float) -> str:
    """Return a number with three significant digits; with an exponent only if it is very small or large."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0.0 else "-∞"
    if abs(value) >= 1e5 or 0.0 < abs(value) < 5e-4:
        return f"{value:.1e}"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _unit(name: str) -> tuple[str, float]:
    return ("%", 100.0) if name.partition(".")[0] in _SHARES else _UNITS.get(_suffix(name), ("", 1.0))


def _suffix(name: str) -> str:
    return next((suffix for suffix in _UNITS if name.endswith(suffix)), "")
