"""Sums of two single effects: which pairs look best before any pair is simulated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.pair import effect_names
from gaitopt.diagnose.fit.settings import PairSettings
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Start:
    """Two fits, and the coordinates at which they are first simulated together.

    Attributes:
        one, other: the fits.
        at: their coordinates, shape (2,).
    """

    one: Fit
    other: Fit
    at: Array

    @property
    def fits(self) -> tuple[Fit, Fit]:
        """Both fits."""
        return self.one, self.other

    def whitened(self, nominal: Comparison) -> Array:
        """Return the whitened residual that the sum of both changes leaves, shape (rows,)."""
        here, there = self.at
        left: Array = self.one.line(here)[0] + self.other.line(there)[0] - nominal.whitened
        return left


def promising_sums(fits: Sequence[Fit], nominal: Comparison, settings: PairSettings) -> list[Start]:
    """Return the sums of two changes that leave least, few of the same effects.

    Each robot simulated with one effect is added to each of another, not only to the one that fits best
    alone: with another effect the best coordinate may differ.
    """
    tried = [fit for fit in fits if len(fit.comparisons) > 1]
    sums = sorted(_best_sums(tried, nominal), key=lambda entry: entry[0])[: settings.refined_sums]
    found = [_refined(start, nominal, settings.sum_turns) for _, start in sums]
    found.sort(key=lambda entry: entry[0])
    starts = [start for _, start in found]
    chosen = few_alike([start.fits for start in starts], settings.simulated_sums, settings.targets)
    return [starts[i] for i in chosen]


def few_alike(
    pairs: Sequence[tuple[Fit, Fit]], most: int, targets: int, before: Sequence[tuple[Fit, Fit]] = ()
) -> list[int]:
    """Return the indices of the first pairs, with a limit on pairs of the same effects.

    Args:
        pairs: the pairs, the best first.
        most: number of pairs at most.
        targets: number of pairs of the same two effects at most.
        before: pairs that count towards that limit already.
    """
    alike = Counter(effect_names(pair) for pair in before)
    chosen: list[int] = []
    for index, pair in enumerate(pairs):
        if alike[effect_names(pair)] < targets and len(chosen) < most:
            alike[effect_names(pair)] += 1
            chosen.append(index)
    return chosen


def least_added(remaining: Array, fit: Fit, nominal: Comparison) -> tuple[float, float]:
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


def _best_sums(fits: Sequence[Fit], nominal: Comparison) -> list[tuple[float, Start]]:
    """Return the best sum of simulated robots for every two effects, with its loss."""
    losses = _losses_of_sums(fits, nominal)
    ends = np.cumsum([0, *(len(fit.comparisons) for fit in fits)])
    found = []
    for (i, one), (j, other) in combinations(enumerate(fits), 2):
        if one.hypothesis.effect.name != other.hypothesis.effect.name:
            block = losses[ends[i] : ends[i + 1], ends[j] : ends[j + 1]]
            row, column = np.unravel_index(int(np.argmin(block)), block.shape)
            at = np.array([one.coordinates[row], other.coordinates[column]])
            found.append((float(block[row, column]), Start(one, other, at)))
    return found


def _losses_of_sums(fits: Sequence[Fit], nominal: Comparison) -> Array:
    """Return the loss with the changes of every two simulated robots added, shape (robots, robots)."""
    changes = np.stack([one.whitened - nominal.whitened for fit in fits for one in fit.comparisons])
    products = changes @ changes.T
    alone = np.diag(products) + 2.0 * changes @ nominal.whitened
    losses: Array = float(nominal.whitened @ nominal.whitened) + alone[:, None] + alone + 2.0 * products
    return losses


def _refined(start: Start, nominal: Comparison, turns: int) -> tuple[float, Start]:
    """Return a sum and its loss, each coordinate in turn moved to where the sum is least."""
    one, other = start.fits
    here, there = start.at
    for _ in range(turns):
        _, there = least_added(one.line(here)[0], other, nominal)
        least, here = least_added(other.line(there)[0], one, nominal)
    return least, Start(one, other, np.array([here, there]))
