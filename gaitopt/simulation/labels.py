"""Metrics and other figures as readers see them: a title, a unit and three significant digits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gaitopt.core.quantities import figure, stem_of, unit_of
from gaitopt.simulation.metrics import AIMS, METRICS

_TITLES: Mapping[str, str] = {
    "name": "gait",
    "speed_ci90": "90 % interval of the speed",
    "speed_worst": "speed in the worst scenario",
    "difference": "difference to the first",
    "difference_ci90": "90 % interval of the difference",
    "ratio": "ratio to the first",
    "ratio_ci90": "90 % interval of the ratio",
}
"""Title of a figure that is no metric, by its name without unit; other names are shown as words."""


def title_of(name: str) -> str:
    """Return the title of a figure without its unit: "forward speed" for ``speed_m_s``."""
    stem, _, part = stem_of(name).partition(".")
    titles = {stem_of(metric.name): metric.title for metric in (METRICS | AIMS).values() if metric.title}
    title = titles.get(stem) or _TITLES.get(stem) or stem.replace("_", " ")
    return title + (f", {part}" if part else "")


def label_of(name: str) -> str:
    """Return the title of a figure with the unit in which `shown` gives it."""
    unit, _ = _unit(name)
    return f"{title_of(name)} [{unit}]" if unit else title_of(name)


def shown(name: str, value: object) -> str:
    """Return a figure's value in the unit of its label; None and NaN are a dash."""
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


def with_unit(name: str, value: float) -> str:
    """Return a figure's value with its unit: "12.3 mm/s"."""
    return f"{shown(name, value)} {_unit(name)[0]}".rstrip()


def _unit(name: str) -> tuple[str, float]:
    """Return the unit in which a figure is shown, and the factor to it."""
    metric = (METRICS | AIMS).get(name.partition(".")[0])
    return ("%", 100.0) if metric is not None and metric.share else unit_of(name)
