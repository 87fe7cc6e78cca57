"""How well a parameter is known, given small unknown errors of the robot and the trials.

Robots are perturbed about a candidate: other start poses, masses, hinges and numerics. If one of them had
been measured, the fit would have a different result. This difference is one part of a parameter's error. The
covariance may be estimated from the same robots; it cannot explain the differences that remain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from gaitopt.core.statistics import NORMAL_95
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.response import Response
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.settings import DEFAULT, DiagnosisSettings

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Precision:
    """Intervals of parameters, given some perturbed robots.

    Attributes:
        changes: change of the whitened residual with each robot perturbed about the first candidate, shape
            (robots, rows).
        settings: how intervals are found.
    """

    changes: Array
    settings: DiagnosisSettings = DEFAULT

    def intervals(self, candidate: Candidate) -> list[Interval]:
        """Return a 90 % interval of each parameter of a candidate, in its unit.

        Its half-width is the root of the sum of two squares: the shift of the fit with perturbed robots, by
        Student's t, and what the tempered likelihood allows.
        """
        unit = self._tempered_square(candidate)
        both = np.concatenate([self.changes, -self.changes])  # an error is as likely as its opposite
        return [] if candidate.alone is None else [self._of_fit(candidate.alone, both, unit)]

    def excludes_neutral(self, candidate: Candidate) -> bool:
        """Whether no parameter's interval includes the value at which its effect does nothing."""
        found = zip(candidate.hypotheses, self.intervals(candidate), strict=True)
        neutral = [(one.value(one.neutral), ends) for one, ends in found]
        return not any(low <= value <= high for value, (low, high) in neutral)

    def _tempered_square(self, candidate: Candidate) -> float:
        """Return the rise of the loss that counts as one square."""
        rows = self.changes.shape[1]
        usual = max(1.0, float(np.sum(self.changes**2)) / max(self.changes.size, 1))
        left = float(candidate.fitted_loss.sum()) / rows
        unit: float = self.settings.evidence.temper * max(1.0, left / usual)
        return unit

    def _of_fit(self, fit: Fit, changes: Array, unit: float) -> Interval:
        """Return an interval with two sides: it is wide on a side where the loss is flat."""
        curve, h = fit.curve, fit.hypothesis
        total = curve.losses.sum(axis=0)
        best = float(curve.at[np.argmin(total)])
        shifted = np.array([curve.at[np.argmin(total + 2.0 * fit.products(row))] for row in changes]) - best
        likely = curve.at[total <= total.min() + self.settings.precision.likely * unit] - best
        near = Response.of_fit(fit, self.settings.response)
        even = (h.high - h.low) * float(self._half_widths(near, changes, unit)[0])
        sides = []
        for side in (-1.0, 1.0):
            uneven = math.hypot(self._reach(side * shifted), float(max(0.0, (side * likely).max())))
            sides.append(best + side * max(even, uneven))
        return in_unit(h, sides)

    def _half_widths(self, near: Response, changes: Array, unit: float) -> Array:
        """Return each interval's half-width in ranges, for a response that is linear but for its jumps."""
        settings = self.settings.precision
        inverse = np.linalg.pinv(near.slopes)
        reaches = [self._reach(column) for column in (-changes @ inverse.T).T]
        allowed = settings.likely * unit + settings.jump_share**2 * near.jump
        likely = np.sqrt(allowed * np.diag(inverse @ inverse.T))
        halves: Array = np.hypot(reaches, likely)
        return halves

    def _reach(self, shifted: Array) -> float:
        """Return how far a fit moves one way at most, in 19 of 20 cases, from its shifts to that side."""
        ahead = shifted[shifted >= 0.0]
        if not len(ahead):
            return 0.0
        factor = stats.t.ppf(self.settings.precision.tail, max(1, len(shifted) // 2))
        return float(factor * np.sqrt(np.mean(ahead**2)))


def in_unit(h: Hypothesis, sides: Sequence[float]) -> Interval:
    """Return the parameter at both ends of an interval, which a range may cut off."""
    low, high = sorted(h.value(min(max(at, h.low), h.high)) for at in sides)
    return low, high


def at_clock(h: Hypothesis, value: float, interval: Interval, step_s: float) -> Interval:
    """Return the interval of a parameter, wider by half a step of the clock where the parameter is a time.

    The simulation knows when something happens to half a step either way. Squares are added.

    Args:
        h: the effect on its target.
        value: the parameter.
        interval: its interval.
        step_s: the timestep, s.
    """
    if h.effect.unit != "s":
        return interval
    halves = [math.hypot(end - value, 0.5 * step_s) for end in interval]
    ends = (value - halves[0], value + halves[1])
    low, high = (end if h.effect.allows(end) else kept for end, kept in zip(ends, interval, strict=True))
    return low, high


def mixed(parts: Sequence[tuple[float, float, Interval]]) -> Interval:
    """Return the 90 % interval of a figure that one of several explanations gives.

    Each gives it a distribution that is normal to either side of the figure that it fits best.

    Args:
        parts: of each explanation its probability, up to a factor, that figure, and its 90 % interval.
    """
    chances, middles, intervals = (np.array(one, dtype=float) for one in zip(*parts, strict=True))
    lows, highs = intervals.T
    below, above = (np.maximum(side, 1e-300) / NORMAL_95 for side in (middles - lows, highs - middles))

    def beyond(at: float, share: float) -> float:
        deviations = (at - middles) / np.where(at < middles, below, above)
        return float(chances @ stats.norm.cdf(deviations) / chances.sum()) - share

    def quantile(ends: Array, share: float) -> float:
        low, high = float(ends.min()), float(ends.max())
        if beyond(low, share) >= 0.0 or beyond(high, share) <= 0.0:  # all are the same, but for rounding
            return low if share < 0.5 else high
        return float(optimize.brentq(beyond, low, high, args=(share,)))

    return quantile(lows, 0.05), quantile(highs, 0.95)
