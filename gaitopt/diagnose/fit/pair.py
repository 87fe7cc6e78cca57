"""The fit of two effects together: simulated pairs, slopes at the best of them, and the next step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.runner import RobotRequest
from gaitopt.diagnose.fit.settings import PairSettings
from gaitopt.diagnose.fit.single import Fit, robot_request
from gaitopt.diagnose.fit.trials import Comparison, TrialSet

Array = NDArray[np.float64]

_NO_MOVE = 1e-10
"""Square of a move, in ranges, that shows no slope."""


@dataclass(eq=False)
class PairFit:
    """Two hypotheses together.

    Attributes:
        fits: their single fits.
        comparisons: simulated pairs.
        slopes: change of the whitened residual with each coordinate, shape (rows, 2).
        max_step: longest next step, in ranges.
    """

    fits: tuple[Fit, Fit]
    comparisons: list[Comparison]
    slopes: Array
    max_step: float = PairSettings.max_step

    @property
    def trial_set(self) -> TrialSet:
        """The trials."""
        return self.fits[0].trial_set

    @property
    def names(self) -> list[str]:
        """The two effects."""
        return [fit.hypothesis.effect.name for fit in self.fits]

    @property
    def effects(self) -> frozenset[str]:
        """The two effects, in no order."""
        return frozenset(self.names)

    @property
    def hypotheses(self) -> frozenset[str]:
        """The two effects with their targets, in no order."""
        return hypothesis_names(self.fits)

    def rewhitened(self, trial_set: TrialSet) -> PairFit:
        """Return the pair with the same trials whitened by another covariance."""
        one, other = self.fits
        before = self.trial_set
        comparisons = [trial_set.rewhiten(comparison, before) for comparison in self.comparisons]
        slopes = trial_set.rewhiten_rows(self.slopes, before)
        fits = one.rewhitened(trial_set), other.rewhitened(trial_set)
        return PairFit(fits, comparisons, slopes, self.max_step)

    def request(self, at: Array) -> RobotRequest:
        """Return the robot to simulate for two coordinates, shape (2,)."""
        hypotheses = [fit.hypothesis for fit in self.fits]
        return robot_request(zip(hypotheses, at.tolist(), strict=True))

    def best(self, weights: Array | None = None) -> Comparison:
        """Return the simulated pair of the least loss, blocks weighted."""
        return min(self.comparisons, key=lambda comparison: self._weighted_loss(comparison, weights))

    def _weighted_loss(self, comparison: Comparison, weights: Array | None) -> float:
        losses = self.trial_set.losses(comparison.whitened)
        return float(losses.sum() if weights is None else weights @ losses)

    @property
    def loss(self) -> float:
        """Loss of the best simulated pair."""
        return float(np.sum(self.best().whitened ** 2))

    @property
    def expected_loss(self) -> float:
        """Loss that the slopes predict after the next step."""
        left = self.best().whitened + self.slopes @ self.step()
        return float(left @ left)

    def step(self, weights: Array | None = None) -> Array:
        """Return the Gauss–Newton step from the best pair, blocks weighted, shape (2,)."""
        best = self.best(weights)
        by_row = np.ones(len(best.whitened)) if weights is None else weights[self.trial_set.row_blocks]
        root = np.sqrt(by_row)[:, None]
        step, *_ = np.linalg.lstsq(root * self.slopes, -root[:, 0] * best.whitened, rcond=None)
        step *= min(1.0, self.max_step / max(float(np.abs(step / self.spans).max()), 1e-9))
        wanted: Array = self.within(best.at + step) - best.at
        return wanted

    def learn(self, comparison: Comparison) -> None:
        """Add a simulated pair: update the slopes as Broyden does, shorten the step if it is worse."""
        before = self.best()
        moved = (comparison.at - before.at) / self.spans
        size = float(moved @ moved)
        if size > _NO_MOVE:
            scaled = self.slopes * self.spans
            missed = comparison.whitened - before.whitened - scaled @ moved
            self.slopes = (scaled + np.outer(missed, moved) / size) / self.spans
        self.comparisons.append(comparison)
        if self.best() is before:
            self.max_step = 0.5 * min(self.max_step, float(np.abs(moved).max()))

    def within(self, at: Array) -> Array:
        """Return the nearest coordinates inside the ranges, shape (2,)."""
        inside: Array = np.clip(at, self._ends(0), self._ends(1))
        return inside

    @property
    def spans(self) -> Array:
        """Length of each coordinate's range, shape (2,)."""
        return self._ends(1) - self._ends(0)

    def _ends(self, side: int) -> Array:
        return np.array([(fit.hypothesis.low, fit.hypothesis.high)[side] for fit in self.fits])


def hypothesis_names(fits: Sequence[Fit]) -> frozenset[str]:
    """Return the names of some fits' hypotheses, in no order."""
    return frozenset(fit.hypothesis.name for fit in fits)


def effect_names(fits: Sequence[Fit]) -> frozenset[str]:
    """Return the names of some fits' effects, in no order."""
    return frozenset(fit.hypothesis.effect.name for fit in fits)
