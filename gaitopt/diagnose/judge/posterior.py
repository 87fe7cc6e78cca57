"""Robots drawn from what is known: sets of effects by their probability, then the parameters of each set.

An explanation is drawn as often as it is probable, "no effect" among them. Its parameters are drawn about
their fit: normal in each effect's coordinate, as wide as their intervals, with the correlation that the fit
gives them, and no further than the mechanisms allow. What no effect explains is no part of these robots;
predictions add it from the evidence of held-out trials (see `diagnose.predictions`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import NORMAL_95
from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.precision import Interval
from gaitopt.effects.active import EffectValue, EffectValues

Array = NDArray[np.float64]

ROBOTS = 128
"""Robots that are drawn: with them the ends of a 90 % interval have six or seven robots beyond them."""


@dataclass(frozen=True)
class Spread:
    """How well the parameters of an explanation are known.

    Attributes:
        hypotheses: its effects, each on its target.
        at: their fitted coordinates, shape (k,).
        below, above: standard deviation of each coordinate to either side, shape (k,).
        correlation: correlation of the coordinates, shape (k, k).
    """

    hypotheses: tuple[Hypothesis, ...]
    at: Array
    below: Array
    above: Array
    correlation: Array

    @staticmethod
    def of_covariance(hypotheses: Sequence[Hypothesis], at: Sequence[float], shares: Array) -> Spread:
        """Return the spread of parameters whose covariance is known in squares of ranges, shape (k, k)."""
        spans = np.array([h.high - h.low for h in hypotheses])
        deviations = spans * np.sqrt(np.diag(shares))
        return Spread(tuple(hypotheses), np.array(at), deviations, deviations, correlation_of(shares))

    def with_intervals(self, intervals: Mapping[str, Interval]) -> Spread:
        """Return the same with some parameters as wide to either side as other evidence than the fit says.

        Args:
            intervals: their 90 % intervals, in their units, by the effects with their targets.
        """
        hypotheses, below, above = [*self.hypotheses], self.below.copy(), self.above.copy()
        for index, h in enumerate(hypotheses):
            if h.name in intervals:
                low, high = map(h.coordinate, intervals[h.name])
                hypotheses[index] = replace(h, low=min(h.low, low), high=max(h.high, high))
                below[index], above[index] = _deviations(self.at[index], low, high)
        return replace(self, hypotheses=tuple(hypotheses), below=below, above=above)

    def robot(self, normal: Array) -> EffectValues:
        """Return the robot that belongs to independent standard normal numbers, shape (k,)."""
        values, vectors = np.linalg.eigh(self.correlation)
        together = vectors @ (np.sqrt(np.maximum(values, 0.0)) * normal)
        moved = self.at + together * np.where(together < 0.0, self.below, self.above)
        drawn = []
        for h, coordinate in zip(self.hypotheses, moved.tolist(), strict=True):
            low, high = map(h.coordinate_at, h.share_limits)
            drawn.append(EffectValue(h.effect.name, h.target, h.value(min(max(coordinate, low), high))))
        return tuple(drawn)


def correlation_of(covariance: Array) -> Array:
    """Return the correlation of a covariance, shape (k, k); a parameter without variance has none."""
    deviations = np.sqrt(np.diag(covariance))
    scale = np.outer(deviations, deviations)
    known = scale > 0.0
    correlation: Array = np.where(known, covariance / np.where(known, scale, 1.0), 0.0)
    np.fill_diagonal(correlation, 1.0)
    return correlation


def draw_robots(found: Causes, seed: int, count: int = ROBOTS) -> tuple[EffectValues, ...]:
    """Return robots drawn from the posterior over explanations, those of one explanation one after another.

    Each explanation has its share of the robots, rounded; those that round to none have none. Where nothing
    was fitted, all robots are nominal.

    Args:
        found: what may have caused the gap.
        seed: seed of the draws.
        count: how many robots.
    """
    chances = found.judgement.chances
    places = (np.arange(count) + 0.5) / count
    chosen = np.minimum(np.searchsorted(np.cumsum(chances), places), len(chances) - 1)
    robots: list[EffectValues] = []
    for index, own in zip(*np.unique(chosen, return_counts=True), strict=True):
        if index == len(found.candidates):  # "no effect" is the last one
            robots += [()] * int(own)
            continue
        spread = spread_of(found, found.candidates[index])
        normals = generator(seed, Stream.POSTERIOR_DRAWS, int(index)).standard_normal((own, len(spread.at)))
        robots += [spread.robot(normal) for normal in normals]
    return tuple(robots)


def spread_of(found: Causes, candidate: Candidate) -> Spread:
    """Return how well the parameters of a candidate are known.

    Those of a set have the covariance of its fit, but for those that other evidence tells. That of one effect
    is as wide to each side as its interval.
    """
    sets, hypotheses = found.judgement.sets, candidate.hypotheses
    if sets is not None and candidate.together is not None:
        shares = sets.covariance(candidate.together, found.changes)
        spread = Spread.of_covariance(hypotheses, candidate.at, shares)
        return spread.with_intervals(sets.other_intervals(candidate.together, shares))
    at = np.array(candidate.at)
    ends = [
        [h.coordinate(end) for end in interval]
        for h, interval in zip(hypotheses, found.intervals(candidate), strict=True)
    ]
    below, above = _deviations(at, *np.array(ends).T)
    return Spread(hypotheses, at, below, above, np.eye(len(at)))


def _deviations(at: Array, low: Array | float, high: Array | float) -> tuple[Array, Array]:
    """Return the standard deviations to either side of coordinates that 90 % intervals stand for."""
    below, above = (np.maximum(side, 0.0) / NORMAL_95 for side in (at - low, high - at))
    return below, above
