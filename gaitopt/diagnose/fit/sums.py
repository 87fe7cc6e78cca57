"""Sums of two single effects: which pairs of effects look best before any pair is simulated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.set_fit import Point
from gaitopt.diagnose.fit.settings import SUMS, SumSettings
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Sum:
    """Two fits, each at a coordinate, and the sum of squares that both changes leave."""

    one: Fit
    other: Fit
    here: float
    there: float
    left: float

    @property
    def effects(self) -> frozenset[str]:
        return frozenset(fit.hypothesis.effect.name for fit in (self.one, self.other))

    @property
    def point(self) -> Point:
        return [(self.one.hypothesis, self.here), (self.other.hypothesis, self.there)]


def best_sums(fits: Sequence[Fit], nominal: Comparison, settings: SumSettings = SUMS) -> list[Point]:
    """Return the sums of two changes that leave least, the best first, few of the same effects.

    Each robot simulated with one effect is added to each of another, not only to the one that fits best
    alone: with another effect the best coordinate may differ. Then both are moved to where the sum is least.

    Args:
        fits: the single fits.
        nominal: the trials compared with the nominal robot.
        settings: how many.
    """
    tried = [fit for fit in fits if len(fit.comparisons) > 1]
    sums = sorted(_sums_of_robots(tried, nominal), key=_left)[: settings.refined]
    found = sorted((_refined(one, nominal, settings.turns) for one in sums), key=_left)
    alike, chosen = Counter[frozenset[str]](), list[Point]()
    for one in found:
        alike[one.effects] += 1
        if alike[one.effects] <= settings.targets:
            chosen.append(one.point)
    return chosen[: settings.kept]


def _left(one: _Sum) -> float:
    return one.left


def _sums_of_robots(fits: Sequence[Fit], nominal: Comparison) -> list[_Sum]:
    """Return the best sum of simulated robots for every two effects."""
    losses = _losses(fits, nominal)
    ends = np.cumsum([0, *(len(fit.comparisons) for fit in fits)])
    found = []
    for (i, one), (j, other) in combinations(enumerate(fits), 2):
        if one.hypothesis.effect.name != other.hypothesis.effect.name:
            block = losses[ends[i] : ends[i + 1], ends[j] : ends[j + 1]]
            row, column = np.unravel_index(int(np.argmin(block)), block.shape)
            here, there = float(one.coordinates[row]), float(other.coordinates[column])
            found.append(_Sum(one, other, here, there, float(block[row, column])))
    return found


def _losses(fits: Sequence[Fit], nominal: Comparison) -> Array:
    """Return the loss with the changes of every two simulated robots added, shape (robots, robots)."""
    changes = np.stack([one.whitened - nominal.whitened for fit in fits for one in fit.comparisons])
    products = changes @ changes.T
    alone = np.diag(products) + 2.0 * changes @ nominal.whitened
    losses: Array = float(nominal.whitened @ nominal.whitened) + alone[:, None] + alone + 2.0 * products
    return losses


def _refined(one: _Sum, nominal: Comparison, turns: int) -> _Sum:
    """Return a sum with each coordinate in turn moved to where the sum is least."""
    here, there, left = one.here, one.there, one.left
    for _ in range(turns):
        _, there = _least_added(one.one.line(here)[0], one.other, nominal)
        left, here = _least_added(one.other.line(there)[0], one.one, nominal)
    return _Sum(one.one, one.other, here, there, left)


def _least_added(remaining: Array, fit: Fit, nominal: Comparison) -> tuple[float, float]:
    """Return the least loss, and its coordinate, when a fit's change is added to a residual.

    Args:
        remaining: whitened residual, shape (rows,).
        fit: the fit.
        nominal: the trials compared with the nominal robot.
    """
    best, at = float(remaining @ remaining), fit.hypothesis.neutral
    for low, high in zip(fit.comparisons[:-1], fit.comparisons[1:], strict=True):
        begin = remaining + low.whitened - nominal.whitened
        along = high.whitened - low.whitened
        share = float(np.clip(-(begin @ along) / max(float(along @ along), 1e-12), 0.0, 1.0))
        moved = begin + share * along
        loss = float(moved @ moved)
        if loss < best:
            best, at = loss, float(low.at[0] + share * (high.at[0] - low.at[0]))
    return best, at
