"""What is believed of the speed of each gait: the posterior's robots, and on top of them a discrepancy.

Each robot predicts the speed of each gait. What a film measures beyond a prediction is a Gaussian process
over the gait space. So each robot, with its own discrepancy, expects other speeds of the gaits that were not
filmed, and robots count by how probable they make the measured speeds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.campaign.gaussian_process import Conditioned, matern
from gaitopt.campaign.settings import BeliefSettings
from gaitopt.core.streams import Stream, generator
from gaitopt.optimise.robots import Expected

Array = NDArray[np.float64]

_STEPS = 33
"""Quantiles of a normal distribution that stand for it in an interval."""

_OUTCOMES = 201
"""Outcomes of a film that are tried for what it is worth."""


@dataclass(frozen=True)
class Filmed:
    """Measured speeds; or drifts, which are ratios without a unit.

    Attributes:
        gaits: index of the gait of each, shape (m,).
        speeds: mean measured speed of each, m/s, shape (m,).
        noise: variance of the error of each mean, m²/s², shape (m,).
    """

    gaits: NDArray[np.int_]
    speeds: Array
    noise: Array


@dataclass(frozen=True)
class Belief:
    """What is believed of the speed of some gaits.

    Attributes:
        robots: expected speed of each gait on each robot with its discrepancy, m/s, shape (robots, gaits).
        weights: probability of each robot, shape (robots,).
        unknown: covariance of the rest of the discrepancy, m²/s², shape (gaits, gaits).
        size_m_s: standard deviation of the discrepancy where nothing was filmed, m/s.
    """

    robots: Array
    weights: Array
    unknown: Array
    size_m_s: float

    @staticmethod
    def of(speeds: Array, points: Array, filmed: Filmed, assumed: float, settings: BeliefSettings) -> Belief:
        """Return what is believed after some films.

        Args:
            speeds: predicted speed of each gait on each robot, m/s, shape (robots, gaits).
            points: points of the gaits, in a space of true distances, shape (gaits, d).
            filmed: the measured speeds.
            assumed: standard deviation of the discrepancy before any film, m/s.
            settings: see `BeliefSettings`.
        """
        length = settings.length
        left = filmed.speeds - speeds[:, filmed.gaits]
        at = points[filmed.gaits]
        variance = _variance(assumed, left.mean(axis=0), at, length, settings)
        process = Conditioned.of(points, at, filmed.noise, variance, length)
        weights = _weights(left, process.measured)
        return Belief(speeds + left @ process.gain.T, weights, process.covariance, math.sqrt(variance))

    @property
    def mean(self) -> Array:
        """Expected speed of each gait, m/s, shape (gaits,)."""
        expected: Array = self.weights @ self.robots
        return expected

    @property
    def covariance(self) -> Array:
        """Covariance of the speeds, m²/s², shape (gaits, gaits)."""
        apart = self.robots - self.mean
        total: Array = (self.weights[:, None] * apart).T @ apart + self.unknown
        return total

    def expected(self, gait: int, noise_m_s: float = 0.0) -> Expected:
        """Return what to expect of a gait's speed; with noise, of what a film would measure.

        Args:
            gait: its index.
            noise_m_s: standard deviation of a measurement, m/s.
        """
        spread = math.sqrt(max(self.unknown[gait, gait], 0.0) + noise_m_s**2)
        normal = stats.norm.ppf((np.arange(_STEPS) + 0.5) / _STEPS)
        values = (self.robots[:, gait, None] + spread * normal).ravel()
        chances = np.repeat(self.weights, _STEPS)
        order = np.argsort(values)
        below = np.cumsum(chances[order]) / chances.sum()
        low, high = (float(values[order][np.searchsorted(below, share)]) for share in (0.05, 0.95))
        return Expected(float(self.mean[gait]), (low, high))

    def worth(self, chances: Array) -> Array:
        """Return the expected speed of each gait where one that breaks its limits counts nothing, m/s.

        Args:
            chances: how probable it is that each gait keeps its limits, shape (gaits,).
        """
        return _worth(self.mean, chances)

    def film_is_worth(self, gait: int, noise_m_s: float, among: Sequence[int], chances: Array) -> float:
        """Return by how much a film of a gait is expected to raise the worth of the best, m/s.

        It is the knowledge gradient of Frazier, Powell and Dayanik, "The Knowledge-Gradient Policy for
        Correlated Normal Beliefs", INFORMS Journal on Computing 21 (2009), by quadrature. The film also
        shows whether the gait keeps its limits. What the motion within the cycle tells does not count: the
        true value is rather higher.

        Args:
            gait: index of the gait that is filmed.
            noise_m_s: standard deviation of a measurement, m/s.
            among: indices of the gaits among which the best is chosen afterwards.
            chances: how probable it is that each gait keeps its limits, shape (gaits,).
        """
        chosen, covariance = list(among), self.covariance
        variance = float(covariance[gait, gait]) + noise_m_s**2
        if variance <= 0.0:
            return 0.0
        mean, slope = self.mean[chosen], covariance[chosen, gait] / math.sqrt(variance)
        outcomes = stats.norm.ppf((np.arange(_OUTCOMES) + 0.5) / _OUTCOMES)
        speeds = mean[None, :] + outcomes[:, None] * slope[None, :]

        def best(kept: float) -> float:
            shown = np.where(np.array(chosen) == gait, kept, chances[chosen])
            return float(_worth(speeds, shown).max(axis=1).mean())

        after = chances[gait] * best(1.0) + (1.0 - chances[gait]) * best(0.0)
        return max(0.0, float(after - _worth(mean, chances[chosen]).max()))

    def still_to_gain(
        self, best: int, among: Sequence[int], chances: Array, seed: int, draws: int
    ) -> Expected:
        """Return how much faster than one gait the truly fastest one that keeps its limits may be, m/s.

        Args:
            best: index of the gait.
            among: indices of the gaits.
            chances: how probable it is that each gait keeps its limits, shape (gaits,).
            seed: seed of the draws.
            draws: how many.
        """
        chosen = sorted({best, *among})
        rng = generator(seed, Stream.CAMPAIGN_BELIEF)
        robots = rng.choice(len(self.weights), size=draws, p=self.weights)
        block = self.unknown[np.ix_(chosen, chosen)]
        values, vectors = np.linalg.eigh(block)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = self.robots[robots][:, chosen] + rng.standard_normal((draws, len(chosen))) @ root.T
        own = drawn[:, chosen.index(best)]
        kept = rng.random(drawn.shape) < chances[chosen]
        gains = np.where(kept, drawn - own[:, None], 0.0).max(axis=1)
        return Expected.of(np.maximum(gains, 0.0).tolist())


def assumed_m_s(speeds: Array, settings: BeliefSettings) -> float:
    """Return the standard deviation of the discrepancy of speeds, shape (robots, gaits), before any film."""
    return settings.size * max(float(np.max(np.abs(speeds.mean(axis=0)), initial=0.0)), 1e-6)


def _worth(speeds: Array, chances: Array) -> Array:
    """Return what gaits are worth that keep their limits with some probability: broken ones count nothing."""
    worth: Array = np.where(speeds > 0.0, chances * speeds, speeds)
    return worth


def _variance(assumed: float, left: Array, at: Array, length: float, settings: BeliefSettings) -> float:
    """Return the variance of the discrepancy: what films show, with an assumption that counts as some."""
    if not len(left):
        return assumed**2
    correlation = matern(at, at, length) + 1e-6 * np.eye(len(at))
    shown = float(left @ np.linalg.solve(correlation, left))
    return (settings.evidence * assumed**2 + shown) / (settings.evidence + len(left))


def _weights(left: Array, covariance: Array) -> Array:
    """Return the probability of each robot by what it leaves of the measured speeds, shape (robots,)."""
    if not left.shape[1]:
        return np.full(len(left), 1.0 / len(left))
    squares = np.einsum("rm,mr->r", left, np.linalg.solve(covariance, left.T))
    likely = np.exp(-0.5 * (squares - squares.min()))
    weights: Array = likely / likely.sum()
    return weights
