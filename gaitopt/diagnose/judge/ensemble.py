"""What recordings tell of the small errors of a robot, and so of how fast it walks in another gait.

Robots that are a little wrong in everything walk the filmed gaits and another one. Those that are like the
recordings tell how fast the real robot is there: a linear regression of the speed on what each robot changes
of the recordings, with the errors of the measurement. It is the update of an ensemble Kalman filter (Evensen,
Ocean Dynamics 53, 2003, 343-367). Each robot in turn then stands for the real one and is predicted by the
others. That tells how far the regression is to be trusted, and how far off it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.optimise.robots import Expected

Array = NDArray[np.float64]

FEWEST = 12
"""With fewer robots nothing is learnt."""

_MODEL = 10.0
"""Covariance of what neither the measurement nor such robots describe, in covariances of the measurement."""


@dataclass(frozen=True)
class Ensemble:
    """Robots with small errors about an explanation.

    Attributes:
        changes: what each robot changes of the residual of the recordings, in standard errors of the
            measurement and the model, shape (robots, rows).
        left: what the explanations leave in the mean, each as it is probable, in the same unit, shape
            (rows,).
        numbers: the number of each robot among those drawn, from 0.
    """

    changes: Array
    left: Array
    numbers: tuple[int, ...]

    @staticmethod
    def of(judgement: Judgement) -> Ensemble | None:
        """Return the robots whose small errors gave the covariance; None of a robot that is made exactly.

        A trial of which the explanations leave more than they should, such as a misfit, counts less.
        """
        robots = judgement.tolerant_robots
        if robots is None:
            return None
        trial_set, explanations = judgement.trial_set, [*judgement.ranking.candidates, judgement.none]
        left = judgement.chances @ np.stack([one.whitened for one in explanations])
        scales = np.sqrt(_MODEL * np.maximum(trial_set.mean_squares(left), 1.0))
        initial = trial_set.initial
        rows = np.column_stack([initial.rewhiten_rows(left, trial_set), robots.changes.T])
        parts = zip(trial_set.trials, initial.split(rows), scales, strict=True)
        found = np.concatenate([one.in_measurement_errors(part) / scale for one, part, scale in parts])
        return Ensemble(found[:, 1:].T, found[:, 0], robots.numbers)

    def first(self, count: int) -> Ensemble:
        """Return the first of these robots."""
        return Ensemble(self.changes[:count], self.left, self.numbers[:count])

    def learnt(self, values: Array, seed: int) -> Expected | None:
        """Return what to expect of a figure of the real robot, from those of these robots.

        Args:
            values: the figure of each robot, NaN where it has none, shape (robots,).
            seed: seed of the errors of the measurement where a robot stands for the real one.

        Returns:
            The mean, and the interval by Student's t; None with fewer than `FEWEST` figures.
        """
        known = np.isfinite(values)
        noise = generator(seed, Stream.ENSEMBLE_NOISE).standard_normal(self.changes.shape)[known]
        changes, values = self.changes[known], values[known]
        if len(values) < FEWEST:
            return None
        apart, predicted = _each_by_the_others(changes, values, noise)
        trust = float(np.clip(apart @ predicted / max(float(predicted @ predicted), 1e-300), 0.0, 1.0))
        shift = trust * _regressed(changes, values, -(self.left + changes.mean(axis=0)))
        error = float(np.sqrt(np.mean((apart - trust * predicted) ** 2)))
        mean, half = float(values.mean()) + shift, float(stats.t.ppf(0.95, len(values) - 1)) * error
        return Expected(mean, (mean - half, mean + half))


def _each_by_the_others(changes: Array, values: Array, noise: Array) -> tuple[Array, Array]:
    """Return how far each robot is from the mean of the others, and how far these predict it to be."""
    apart, predicted = np.empty(len(values)), np.empty(len(values))
    for index in range(len(values)):
        others = np.arange(len(values)) != index
        apart[index] = values[index] - values[others].mean()
        seen = changes[index] - changes[others].mean(axis=0) + noise[index]
        predicted[index] = _regressed(changes[others], values[others], seen)
    return apart, predicted


def _regressed(changes: Array, values: Array, seen: Array) -> float:
    """Return how far a robot's figure is from the mean, by how far its recordings are from the mean.

    Args:
        changes: what each robot changes, in standard errors, shape (robots, rows).
        values: the figure of each robot, shape (robots,).
        seen: what the robot changes, with errors of variance 1, from the mean of these, shape (rows,).
    """
    count = len(values) - 1
    own, weights = changes - changes.mean(axis=0), values - values.mean()
    inside = own @ own.T / count + np.eye(len(values))
    return float(weights @ np.linalg.solve(inside, own @ seen)) / count
