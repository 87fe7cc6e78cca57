"""How far a gait stays from the limits of the objective and from the bounds of the search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace, Range
from gaitopt.optimise.verification import Verified
from gaitopt.problem.problem import Problem
from gaitopt.simulation.labels import with_unit
from gaitopt.simulation.metrics import mean_metrics

CLOSE = 0.05
"""A margin below this share of its limit is worth a warning: what is not known of a robot exceeds it."""

_AT_BOUND = 0.01
"""Closer to a bound than this share of the range is at the bound."""


@dataclass(frozen=True)
class Margin:
    """One limit of the objective and what a gait leaves of it.

    Attributes:
        constraint: the metric.
        side: ``max`` or ``min``.
        limit: the limit.
        value: what is held against it: the mean of the metric over the scenarios, or as
            `Objective.limits_over_scenarios` says. Of drifts, the mean size.
        worst: value in the scenario that is closest to the limit, or farthest beyond.
        margin: what the value leaves of the limit, as a share of it; negative beyond, NaN for a limit of 0.
        broken_in: the scenarios beyond the limit, from 1 in their order.
        scenarios: number of scenarios.
    """

    constraint: str
    side: str
    limit: float
    value: float
    worst: float
    margin: float
    broken_in: tuple[int, ...]
    scenarios: int

    @property
    def allowed(self) -> str:
        """The limit in words: "at most 5 %"."""
        return f"at {'most' if self.side == 'max' else 'least'} {with_unit(self.constraint, self.limit)}"


def margins(problem: Problem, verified: Verified) -> tuple[Margin, ...]:
    """Return every limit of a problem's objective with what a verified gait leaves of it.

    A gait that failed in a scenario has none.
    """
    objective = problem.file.objective
    if objective is None or verified.evaluation.status != "ok":
        return ()
    rows = [mean_metrics([row]) for row in verified.rows]
    return tuple(
        _margin(name, side, limit, [row[name] for row in rows], objective.breaking_share(constraint))
        for name, constraint in objective.constraints.items()
        for side, limit in (("max", constraint.max), ("min", constraint.min))
        if limit is not None
    )


def _margin(name: str, side: str, limit: float, values: Sequence[float], breaking: float | None) -> Margin:
    sign = 1.0 if side == "max" else -1.0
    sizes = sign * np.array(values)  # the larger, the worse
    judged = float(sizes.mean() if breaking is None else np.quantile(sizes, 1.0 - breaking))
    left = (sign * limit - judged) / abs(limit) if limit else math.nan
    broken = tuple((np.flatnonzero(sizes > sign * limit) + 1).tolist())
    worst = sign * float(sizes.max())
    return Margin(name, side, limit, sign * judged, worst, left, broken, len(values))


def at_bounds(space: GaitSpace, gait: Gait) -> tuple[tuple[str, str], ...]:
    """Return the numbers of a gait that lie at a bound of the search, each with ``lower`` or ``upper``.

    A bound of a servo's travel, or of what there is, such as an amplitude of 0, is none of the search.
    """
    found = []
    for variable, share in zip(space.variables, space.encode(gait).tolist(), strict=True):
        low, high = _bounds(space, variable.name)
        if low >= high:
            continue
        if share <= _AT_BOUND and not _given(space, variable.name, low):
            found.append((variable.name, "lower"))
        elif share >= 1.0 - _AT_BOUND and not _given(space, variable.name, high):
            found.append((variable.name, "upper"))
    return tuple(found)


def _bounds(space: GaitSpace, variable: str) -> Range:
    """Return the range of a number that a search may choose within; an empty one for the others."""
    channel, _, key = variable.rpartition(".")
    if not channel:
        return space.period_s
    one = space.channels[channel]
    return {"duty": one.duty, "amplitude_deg": one.amplitude_deg}.get(key, (0.0, 0.0))


def _given(space: GaitSpace, variable: str, bound: float) -> bool:
    """Whether a bound of an amplitude is that of its servo's travel, or an amplitude of 0."""
    channel, _, key = variable.rpartition(".")
    if key != "amplitude_deg":
        return False
    low, high = space.channels[channel].range_deg
    return bound == 0.0 or abs(bound) >= high - low


def closest(found: Sequence[Margin]) -> list[Margin]:
    """Return the limits that are kept by less than `CLOSE`, the closest first."""
    near = [one for one in found if 0.0 <= one.margin < CLOSE]
    return sorted(near, key=lambda one: one.margin)
