"""How the whitened residual responds to the parameters near a simulated robot: slopes and jumps.

Contacts make the response jagged. It jumps from one simulated robot to the next, so slopes over short
distances are steep, and the best of several near robots is best by chance. So the slopes are fitted to all
near robots together, and the nearest robots' deviations from them count as chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.settings import RESPONSE, ResponseSettings
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison, TrialSet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """Slopes and jumps near a robot.

    Attributes:
        slopes: change of the whitened residual over each parameter's whole range, shape (rows, parameters).
        jump: squared deviation of a near robot's residual from the slopes, the median.
        loss_jumps: deviation of a near robot's loss of each trial, the median, shape (trials,).
    """

    slopes: Array
    jump: float
    loss_jumps: Array

    @staticmethod
    def of_fit(fit: Fit, settings: ResponseSettings = RESPONSE) -> Response:
        """Return the response near a fit's best robot."""
        best, h = fit.best(), fit.hypothesis
        nearest = min(fit.comparisons, key=lambda one: abs(float(one.at[0]) - best))
        near = _Near.of(fit.comparisons, nearest, np.array([h.high - h.low]))
        return near.response(fit.trial_set, near.slopes_on_both_sides(settings), settings)


@dataclass(frozen=True)
class _Near:
    """Simulated robots about one of them.

    Attributes:
        best: the robot in the middle.
        moved: distance of each robot's parameters from it, in ranges, shape (robots, parameters).
        changes: change of the whitened residual, shape (robots, rows).
        distance: largest distance of any parameter, in ranges, shape (robots,).
    """

    best: Comparison
    moved: Array
    changes: Array
    distance: Array

    @staticmethod
    def of(comparisons: Sequence[Comparison], best: Comparison, spans: Array) -> _Near:
        moved = np.array([(one.at - best.at) / spans for one in comparisons])
        changes = np.array([one.whitened - best.whitened for one in comparisons])
        return _Near(best, moved, changes, np.abs(moved).max(axis=1))

    def within(self, distance: float) -> NDArray[np.bool_]:
        """Return which robots are at most so far, the middle one not among them, shape (robots,)."""
        near: NDArray[np.bool_] = (self.distance > 0.0) & (self.distance <= distance)
        return near

    def slopes_on_both_sides(self, settings: ResponseSettings) -> Array:
        """Return the slopes with one parameter, on each side one robot that is not too close among them."""
        shown = self.within(settings.near)
        for side in (-1.0, 1.0):
            beyond = np.where(side * self.moved[:, 0] > 0.0, self.distance, np.inf)
            beyond[self.distance <= settings.close] = np.inf
            shown[np.argmin(beyond)] |= bool(np.isfinite(beyond).any())
        return self._slopes(shown)

    def _slopes(self, shown: NDArray[np.bool_]) -> Array:
        solved, *_ = np.linalg.lstsq(self.moved[shown], self.changes[shown], rcond=None)
        slopes: Array = np.asarray(solved.T, dtype=float)
        return slopes

    def response(self, trial_set: TrialSet, slopes: Array, settings: ResponseSettings) -> Response:
        """Return the slopes with the jumps of the nearest robots."""
        near = self.within(settings.near)
        ordered = np.flatnonzero(near)[np.argsort(self.distance[near], kind="stable")]
        nearest = ordered[: settings.nearest]
        smooth = self.moved[nearest] @ slopes.T
        if not len(nearest):
            return Response(slopes, 0.0, np.zeros(trial_set.n_trials))
        jumps = np.sum((self.changes[nearest] - smooth) ** 2, axis=1)

        def losses(changes: Array) -> Array:
            rows = [self.best.whitened + change for change in changes]
            return np.array([trial_set.by_trial(trial_set.losses(row)) for row in rows])

        loss_jumps: Array = np.abs(losses(self.changes[nearest]) - losses(smooth))
        typical: Array = np.median(loss_jumps, axis=0)
        return Response(slopes, float(np.median(jumps)), typical)
