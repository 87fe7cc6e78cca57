"""The fit of one effect to a set of trials, with as few simulations as possible.

All comparisons are kept, and between two simulated robots the whitened residual is taken to change linearly
with the parameter's coordinate. So the loss of each block is known along the whole range: leaving a gait out,
resampling cycles and profiling cost no simulation. Nothing is predicted beyond the outermost robots: they lie
at the bounds, or are the last ones that could be simulated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.runner import RobotRequest
from gaitopt.diagnose.fit.settings import FIT, FitSettings
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.effects.active import Values

Array = NDArray[np.float64]
Residual = Literal["whitened", "marker", "angles"]

_SAME = 1e-6
"""A coordinate closer than this share of the range to a simulated one is that one."""


@dataclass(frozen=True)
class Curve:
    """The loss of each block along a hypothesis' range.

    Attributes:
        at: coordinates, ascending, shape (n,).
        losses: loss of each block, shape (blocks, n).
        left: index of the simulated robot to the left of each coordinate, shape (n,).
        share: how far each coordinate is to the next simulated robot, 0 to 1, shape (n,).
    """

    at: Array
    losses: Array
    left: NDArray[np.intp]
    share: Array

    @staticmethod
    def through(trial_set: TrialSet, comparisons: Sequence[Comparison], per_interval: int) -> Curve:
        """Return the curve through some simulated robots, linear residuals between them."""
        if len(comparisons) == 1:
            (alone,) = comparisons
            none = np.zeros(1)
            return Curve(alone.at[:1], trial_set.losses(alone.whitened)[:, None], none.astype(np.intp), none)
        at, losses, lefts, shares = [], [], [], []
        last = len(comparisons) - 2
        for left in range(last + 1):
            low, high = comparisons[left], comparisons[left + 1]
            share = np.arange(per_interval) / per_interval
            gap = float(high.at[0] - low.at[0])
            if left == last:
                share = np.append(share, 1.0)
            pairs = ((low, low), (low, high), (high, high))
            own, mixed, other = (trial_set.products(a.whitened, b.whitened)[:, None] for a, b in pairs)
            losses.append((1.0 - share) ** 2 * own + 2.0 * share * (1.0 - share) * mixed + share**2 * other)
            at.append(low.at[0] + share * gap)
            lefts.append(np.full(len(share), left, dtype=np.intp))
            shares.append(share)
        return Curve(
            np.concatenate(at), np.concatenate(losses, axis=1), np.concatenate(lefts), np.concatenate(shares)
        )


@dataclass
class Fit:
    """One hypothesis and the robots simulated for it.

    Attributes:
        hypothesis: the hypothesis.
        trial_set: the trials.
        comparisons: simulated robots in order of their coordinate, the nominal one among them.
        failed: coordinates that could not be simulated.
        settings: how the effect is fitted.
    """

    hypothesis: Hypothesis
    trial_set: TrialSet
    comparisons: list[Comparison]
    failed: list[float] = field(default_factory=list)
    settings: FitSettings = FIT
    _curve: Curve | None = field(default=None, repr=False)

    @staticmethod
    def of(hypothesis: Hypothesis, trial_set: TrialSet, nominal: Comparison, settings: FitSettings) -> Fit:
        """Return the fit of a hypothesis for which only the nominal robot is known."""
        neutral = replace(nominal, at=np.array([hypothesis.neutral]))
        return Fit(hypothesis, trial_set, [neutral], settings=settings)

    def rewhitened(self, trial_set: TrialSet) -> Fit:
        """Return the fit with the same trials whitened by another covariance."""
        comparisons = [trial_set.rewhiten(one, self.trial_set) for one in self.comparisons]
        return Fit(self.hypothesis, trial_set, comparisons, [*self.failed], self.settings)

    def add(self, at: float, comparison: Comparison | None) -> None:
        """Add a robot; None if it could not be simulated."""
        self._curve = None
        if comparison is None:
            self.failed.append(at)
            return
        self.comparisons = sorted([*self.comparisons, comparison], key=lambda one: float(one.at[0]))

    def request(self, at: float) -> RobotRequest:
        """Return the robot to simulate for a coordinate."""
        return robot_request([(self.hypothesis, at)])

    @property
    def curve(self) -> Curve:
        """The loss along the range."""
        if self._curve is None:
            self._curve = Curve.through(self.trial_set, self.comparisons, self.settings.per_interval)
        return self._curve

    def best(self, weights: Array | None = None) -> float:
        """Return the coordinate of the least loss, blocks weighted."""
        return float(self.curve.at[self._least(weights)])

    def _least(self, weights: Array | None = None) -> int:
        curve = self.curve
        total = curve.losses.sum(axis=0) if weights is None else weights @ curve.losses
        return int(np.argmin(total))

    def loss(self, weights: Array | None = None) -> Array:
        """Return the loss of each block where the weighted one is least, shape (blocks,)."""
        column: Array = self.curve.losses[:, self._least(weights)]
        return column

    def at_best(self, residual: Residual, weights: Array | None = None) -> Array:
        """Return a residual, by its name in `Comparison`, where the weighted loss is least."""
        curve, index = self.curve, self._least(weights)
        left, share = int(curve.left[index]), float(curve.share[index])
        if len(self.comparisons) == 1:
            return np.asarray(getattr(self.comparisons[0], residual))
        low, high = (getattr(one, residual) for one in self.comparisons[left : left + 2])
        mixed: Array = (1.0 - share) * low + share * high
        return mixed

    def line(self, at: float) -> tuple[Array, Array]:
        """Return the whitened residual at a coordinate, between simulated robots, and its slope there."""
        known = self.coordinates
        right = int(np.clip(np.searchsorted(known, at), 1, len(known) - 1))
        low, high = self.comparisons[right - 1], self.comparisons[right]
        gap = known[right] - known[right - 1]
        share = (at - known[right - 1]) / gap
        mixed: Array = (1.0 - share) * low.whitened + share * high.whitened
        slope: Array = (high.whitened - low.whitened) / gap
        return mixed, slope

    @property
    def coordinates(self) -> Array:
        """Coordinates of the simulated robots, ascending, shape (robots,)."""
        return np.array([float(one.at[0]) for one in self.comparisons])

    def products(self, row: Array) -> Array:
        """Return the inner product of the whitened residual with another, along the curve, shape (n,)."""
        curve, last = self.curve, len(self.comparisons) - 1
        products = np.array([float(one.whitened @ row) for one in self.comparisons])
        along: Array = (1.0 - curve.share) * products[curve.left]
        along += curve.share * products[np.minimum(curve.left + 1, last)]
        return along

    def cosine(self, other: Fit) -> float:
        """Return the largest cosine between the changes by two effects, over their simulated robots."""
        one, two = self._changes(), other._changes()
        sizes = np.outer(np.linalg.norm(one, axis=1), np.linalg.norm(two, axis=1))
        return float(np.max(np.abs(one @ two.T) / np.maximum(sizes, 1e-12), initial=0.0))

    def _changes(self) -> Array:
        """Return the whitened changes of the simulated robots from the neutral one, shape (robots, rows)."""
        changes: Array = np.stack([one.whitened for one in self.comparisons]) - self.neutral.whitened
        return changes

    @property
    def neutral(self) -> Comparison:
        """The robot without the effect."""
        return min(self.comparisons, key=lambda one: abs(float(one.at[0]) - self.hypothesis.neutral))

    def unscreened(self) -> list[float]:
        """Return the coordinates at which the hypothesis is tried first and was not simulated yet."""
        tried = self.hypothesis.screened(self.settings)
        known, same = [*self.coordinates.tolist(), *self.failed], _SAME * self._width
        return [at for at in tried if min(abs(at - one) for one in known) > same]

    @property
    def promise(self) -> float:
        """The larger share of the loss that robots on one side promise to remove, see `promise_of`."""
        return max((self.promise_of(bound) for bound in self.hypothesis.sides), default=0.0)

    def promise_of(self, at: float) -> float:
        """Return what share of the loss the robots tried on that side of neutral promise to remove.

        The change of one of them is multiplied by the positive number that removes most. The share is 1 where
        none could be simulated.
        """
        neutral = self.hypothesis.neutral
        side = (self.coordinates - neutral) * (at - neutral) > 0.0
        changes, left = self._changes()[side], self.neutral.whitened
        sizes = np.linalg.norm(changes, axis=1) * np.linalg.norm(left)
        cosines = -(changes @ left) / np.maximum(sizes, 1e-12)
        return float(np.max(np.maximum(cosines, 0.0) ** 2, initial=0.0)) if side.any() else 1.0

    def around_best(self) -> list[float]:
        """Return where the least loss is, and the simulated robots beside it; not the neutral one."""
        known, best, same = self.coordinates, self.best(), _SAME * self._width
        found = [*known[known < best - same][-1:], best, *known[known > best + same][:1]]
        return [float(at) for at in found if abs(at - self.hypothesis.neutral) > same]

    def next_coordinate(self) -> float | None:
        """Return the coordinate to simulate next, or None where that would show nothing new."""
        at = self._next() if len(self.comparisons) > 1 else None
        return None if at is None or at in self.failed else at

    def _next(self) -> float | None:
        settings, known, best = self.settings, self.coordinates, self.best()
        index = int(np.abs(known - best).argmin())
        measurement = self.hypothesis.measurement_only
        share = settings.tolerance_measurement if measurement else settings.tolerance
        tolerance = share * self._width
        if abs(float(known[index]) - best) > tolerance:
            return best
        # The least loss is at a simulated robot: look to the side where the loss rises less.
        sides = []
        for other in (index - 1, index + 1):
            if 0 <= other < len(known):
                gap = known[other] - known[index]
                if abs(gap) > settings.aside_tolerances * tolerance:
                    aside = known[index] + settings.aside * gap
                    sides.append((self._total(aside), aside))
        return float(min(sides)[1]) if sides else None

    def unconfirmed(self) -> float | None:
        """Return the best coordinate if its residual is not yet close to that of a simulated robot."""
        best, white = self.best(), self.at_best("whitened")
        nearest = min(float(np.mean((one.whitened - white) ** 2)) for one in self.comparisons)
        distance = min(abs(float(one.at[0]) - best) for one in self.comparisons)
        known = best in self.failed or distance <= _SAME * self._width
        return best if nearest > self.settings.close and not known else None

    @property
    def _width(self) -> float:
        return self.hypothesis.high - self.hypothesis.low

    def _total(self, at: float) -> float:
        curve = self.curve
        return float(np.interp(at, curve.at, curve.losses.sum(axis=0)))


def robot_request(parameters: Iterable[tuple[Hypothesis, float]]) -> RobotRequest:
    """Return the robot with some hypotheses, each at a coordinate."""
    effects: dict[str, Values] = {}
    at, measurement_only = [], True
    for hypothesis, coordinate in parameters:
        effects[hypothesis.effect.name] = hypothesis.values(coordinate)
        at.append(coordinate)
        measurement_only = measurement_only and hypothesis.measurement_only
    return RobotRequest(effects, tuple(at), measurement_only)
