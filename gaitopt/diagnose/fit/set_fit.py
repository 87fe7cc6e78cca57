"""The fit of a set of effects of any size: Gauss–Newton steps within a trust region, by a robust loss.

Coordinates are counted in ranges: 0 to 1 is what is searched first. The slopes of the whitened residual are
measured by one simulated robot for each effect, and updated after each step as Broyden does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.products import Products, RowBlocks
from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.runner import RobotRequest
from gaitopt.diagnose.fit.settings import SetSettings
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison

Array = NDArray[np.float64]

Simulate = Callable[[Sequence[RobotRequest]], "list[Comparison | None]"]
"""Compares the trials with robots; None for a robot that cannot be simulated."""

Point = Sequence[tuple[Hypothesis, float]]
"""Effects, each at a coordinate."""

_NO_MOVE = 1e-12
"""Square of a move, in ranges, that shows no slope."""


@dataclass(frozen=True)
class SetFit:
    """A set of effects, fitted together.

    Attributes:
        hypotheses: the effects, each on its target.
        robot: the best simulated robot; its coordinates are the fit, shape (k,).
        slopes: change of the whitened residual with each coordinate, in ranges, shape (rows, k).
        sample_slopes: the same of the residual of each sample: the marker's, then the angles'; shape
            (samples, k). Zero where they were not measured.
        loss: the robust loss with the prior.
        radius: longest next step of a coordinate, in ranges.
        rows: block of each row, and trial of each block.
        measured: whether the slopes are those of simulated robots near this one.
    """

    hypotheses: tuple[Hypothesis, ...]
    robot: Comparison
    slopes: Array
    sample_slopes: Array
    loss: float
    radius: float
    rows: RowBlocks
    measured: bool = False

    @cached_property
    def products(self) -> Products:
        """Inner products of residual and slopes, block by block."""
        return Products.of(self.robot.whitened, self.slopes, self.rows)

    @property
    def point(self) -> list[tuple[Hypothesis, float]]:
        """The effects, each at its coordinate."""
        return [*zip(self.hypotheses, self.robot.at.tolist(), strict=True)]

    @property
    def names(self) -> frozenset[str]:
        """The effects with their targets."""
        return frozenset(one.name for one in self.hypotheses)

    @property
    def effects(self) -> list[str]:
        """The effects without their targets."""
        return [one.effect.name for one in self.hypotheses]

    @property
    def shares(self) -> Array:
        """The coordinates in ranges, shape (k,)."""
        return np.array([h.share(at) for h, at in self.point])

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Smallest and largest coordinates, in ranges, each of shape (k,)."""
        ends = np.array([h.share_limits for h in self.hypotheses]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]


@dataclass(frozen=True)
class SetFitter:
    """Fits sets of effects.

    Attributes:
        loss: the loss of a whitened residual.
        simulate: compares the trials with robots.
        rows: blocks and trials of the rows.
        settings: how sets are fitted.
    """

    loss: RobustLoss
    simulate: Simulate
    rows: RowBlocks
    settings: SetSettings

    def empty(self, nominal: Comparison) -> SetFit:
        """Return the fit of no effect."""
        rows, samples = len(nominal.whitened), len(nominal.marker) + len(nominal.angles)
        robot = replace(nominal, at=np.empty(0))
        loss = self.loss.total(nominal.whitened)
        return SetFit((), robot, np.empty((rows, 0)), np.empty((samples, 0)), loss, 0.0, self.rows)

    def placed(self, points: Sequence[Point]) -> list[SetFit]:
        """Return sets at some coordinates, without slopes; those that cannot be simulated are left out."""
        robots = self.simulate([robot_request(point) for point in points])
        fits = []
        for point, robot in zip(points, robots, strict=True):
            if robot is not None:
                rows, samples = len(robot.whitened), len(robot.marker) + len(robot.angles)
                slopes, sample_slopes = np.zeros((rows, len(point))), np.zeros((samples, len(point)))
                hypotheses = tuple(hypothesis for hypothesis, _ in point)
                fits.append(self._fit(hypotheses, robot, slopes, sample_slopes, self.settings.first_radius))
        return fits

    def score(self, fit: SetFit) -> float:
        """Return the loss with the price of each effect, by which sets of different size compare."""
        return fit.loss + self.price(fit)

    def price(self, fit: SetFit) -> float:
        """Return the loss that the effects of a set must save, or they are left out."""
        return sum(self.settings.price + one.effect.unusual for one in fit.hypotheses)

    def with_effect(self, fit: SetFit, hypothesis: Hypothesis, at: float, robot: Comparison) -> SetFit:
        """Return a set with one more effect, still at its neutral value; a rough one where it was tried.

        Where `SetSettings.centred` says so, each begins at the better one of the two.

        Args:
            fit: the set without it.
            hypothesis: the effect.
            at: a coordinate of it.
            robot: the robot of the set with the effect at that coordinate.
        """
        moved = hypothesis.moved(at)
        column = (robot.whitened - fit.robot.whitened) / moved
        samples = (_samples(robot) - _samples(fit.robot)) / moved
        neutral = replace(fit.robot, at=np.append(fit.robot.at, hypothesis.neutral))
        if self.settings.centred:
            centres = [neutral, robot]
        else:
            centres = [robot if hypothesis.effect.rough else neutral]
        begun = [
            self._fit(
                (*fit.hypotheses, hypothesis),
                centre,
                np.column_stack([fit.slopes, column]),
                np.column_stack([fit.sample_slopes, samples]),
                self.settings.first_radius,
            )
            for centre in centres
        ]
        return min(begun, key=lambda one: one.loss)

    def without_effect(self, fit: SetFit, index: int) -> SetFit:
        """Return a set without one of its effects; its residual is the one that the slopes predict."""
        hypothesis = fit.hypotheses[index]
        moved = hypothesis.share(hypothesis.neutral) - fit.shares[index]
        robot = replace(
            fit.robot,
            at=np.delete(fit.robot.at, index),
            whitened=fit.robot.whitened + fit.slopes[:, index] * moved,
        )
        left = tuple(h for i, h in enumerate(fit.hypotheses) if i != index)
        slopes, samples = (np.delete(one, index, axis=1) for one in (fit.slopes, fit.sample_slopes))
        return self._fit(left, robot, slopes, samples, self.settings.first_radius)

    def at_robot(self, fit: SetFit, robot: Comparison) -> SetFit:
        """Return a set at another robot, with the slopes that it has."""
        return replace(fit, robot=robot, loss=self._loss(fit, robot))

    def stepped(self, fit: SetFit, step: Array) -> SetFit:
        """Return a set after a step, in ranges; its residual is the one that the slopes predict."""
        shares = fit.shares + step
        at = [h.coordinate_at(s) for h, s in zip(fit.hypotheses, shares.tolist(), strict=True)]
        whitened = fit.robot.whitened + fit.slopes @ step
        robot = replace(fit.robot, at=np.array(at), whitened=whitened)
        return self.at_robot(fit, robot)

    def expected(self, fit: SetFit, weights: Array | None = None) -> tuple[Array, float]:
        """Return the step to where the slopes predict the least loss, in ranges, and that loss.

        Args:
            fit: the set.
            weights: of each block, shape (blocks,); None for equal weights.
        """
        if not fit.hypotheses:
            return np.empty(0), fit.loss
        step, prior = np.zeros(len(fit.hypotheses)), self.prior_rows(fit)
        for _ in range(self.settings.reweighted):
            step = self._step(fit, step, prior, weights)
        squares = self.rows.by_trial(fit.products.squares(step))
        return step, float(self.loss.of_squares(squares).sum()) + self._prior(fit, fit.shares + step)

    def curvature(self, fit: SetFit, weights: Array) -> Array:
        """Return half the second derivatives of the loss of a set, per squares of ranges, shape (k, k).

        Args:
            fit: the set.
            weights: of each trial, shape (trials,).
        """
        _, prior = self.prior_rows(fit)
        weighted = weights[self.loss.row_trials][:, None] * fit.slopes
        curvature: Array = fit.slopes.T @ weighted + np.diag(prior**2)
        return curvature

    def expected_score(self, fit: SetFit) -> float:
        """Return the score that the slopes predict."""
        return self.expected(fit)[1] + self.price(fit)

    def descend(self, fits: Sequence[SetFit], rounds: int) -> list[SetFit]:
        """Return the fits after some steps each; in each round two steps of different length are tried."""
        current = list(fits)
        for _ in range(rounds):
            work = []
            for index, fit in enumerate(current):
                if self._settled(fit):
                    continue
                for radius in (fit.radius, self.settings.shorter * fit.radius):
                    step = self._reweighted_step(fit, radius)
                    work.append((index, fit.shares + step, radius))
            if not work:
                break
            robots = self.simulate([_request(current[i].hypotheses, shares) for i, shares, _ in work])
            for index in sorted({i for i, _, _ in work}):
                own = [(s, r, robot) for (i, s, r), robot in zip(work, robots, strict=True) if i == index]
                current[index] = self._learnt(current[index], own)
        return current

    def measure_slopes(self, fits: Sequence[SetFit]) -> list[SetFit]:
        """Return the fits with slopes measured by one simulated robot for each effect."""
        work = []
        for index, fit in enumerate(fits):
            for column, shares in enumerate(self._aside(fit)):
                work.append((index, column, shares))
        robots = self.simulate([_request(fits[i].hypotheses, shares) for i, _, shares in work])
        measured = [replace(fit, measured=True, radius=self._wider(fit)) for fit in fits]
        for (index, column, shares), robot in zip(work, robots, strict=True):
            if robot is not None:
                measured[index] = self._with_slope(fits[index], measured[index], column, shares, robot)
        return measured

    def _with_slope(
        self, fit: SetFit, measured: SetFit, column: int, shares: Array, robot: Comparison
    ) -> SetFit:
        """Return a fit with one measured slope, at that robot where it is better."""
        moved = float(shares[column] - fit.shares[column])
        slopes, samples = measured.slopes.copy(), measured.sample_slopes.copy()
        slopes[:, column] = (robot.whitened - fit.robot.whitened) / moved
        samples[:, column] = (_samples(robot) - _samples(fit.robot)) / moved
        measured = replace(measured, slopes=slopes, sample_slopes=samples)
        loss = self._loss(fit, robot)
        return replace(measured, robot=robot, loss=loss) if loss < measured.loss else measured

    def _wider(self, fit: SetFit) -> float:
        return max(fit.radius, self.settings.least_radius * 4.0)

    def _aside(self, fit: SetFit) -> list[Array]:
        """Return for each effect the coordinates, in ranges, with that effect a little aside."""
        _, high = fit.limits
        every = []
        for column in range(len(fit.hypotheses)):
            shares = fit.shares.copy()
            ahead = shares[column] + self.settings.difference
            shares[column] = ahead if ahead <= high[column] else shares[column] - self.settings.difference
            every.append(shares)
        return every

    def _settled(self, fit: SetFit) -> bool:
        if not fit.hypotheses or fit.radius < self.settings.least_radius:
            return True
        return fit.loss - self.expected(fit)[1] < self.settings.least_gain

    def _reweighted_step(self, fit: SetFit, radius: float) -> Array:
        return self.expected(replace(fit, radius=radius))[0]

    def _step(
        self, fit: SetFit, before: Array, prior_rows: tuple[Array, Array], weights: Array | None
    ) -> Array:
        """Return the weighted least-squares step within the limits, in ranges, shape (k,).

        Args:
            fit: the set.
            before: a step; the trials are weighted by what the slopes predict after it, shape (k,).
            prior_rows: the prior's residual of each effect, and its slope, each of shape (k,).
            weights: of each block; None for equal weights.
        """
        products, shares = fit.products, fit.shares
        by_trial = self.loss.trial_weights(self.rows.by_trial(products.squares(before)))
        by_block = by_trial[self.rows.trials] * (1.0 if weights is None else weights)
        prior, slope = prior_rows
        curvature = np.tensordot(by_block, products.slopes, 1) + np.diag(slope**2)
        gradient = by_block @ products.mixed + slope * prior
        scale = np.sqrt(np.maximum(np.diag(curvature), 1e-12))
        lower = np.linalg.cholesky(curvature / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)))
        target = -solve_triangular(lower, gradient / scale, lower=True)
        low, high = fit.limits
        below = np.maximum(low - shares, -fit.radius) * scale
        above = np.maximum(np.minimum(high - shares, fit.radius) * scale, below + 1e-9 * scale)
        found = lsq_linear(lower.T, target, bounds=(below, above), method="bvls")
        step: Array = found.x / scale
        return step

    def prior_rows(self, fit: SetFit) -> tuple[Array, Array]:
        """Return the prior's residual of each effect, and its slope, each of shape (k,)."""
        here = np.array([self._distance(h, s) for h, s in zip(fit.hypotheses, fit.shares, strict=True)])
        delta = 1e-3
        ahead = np.array(
            [self._distance(h, s + delta) for h, s in zip(fit.hypotheses, fit.shares, strict=True)]
        )
        freedom = self.settings.prior_freedom
        root = np.sqrt(self.settings.prior_weight * (freedom + 1.0) / (freedom + here**2))
        return root * here, root * (ahead - here) / delta

    def _distance(self, hypothesis: Hypothesis, share: float) -> float:
        """Return how far a coordinate is from the middle of its prior, in standard deviations."""
        coordinate = hypothesis.coordinate_at(share)
        square = max(0.0, -2.0 * hypothesis.log_prior(coordinate))
        aside = -2.0 * hypothesis.log_prior(hypothesis.coordinate_at(share + 1e-4))
        return float(np.copysign(np.sqrt(min(square, 1e6)), aside - square))

    def _prior(self, fit: SetFit, shares: Array) -> float:
        """Return minus twice the logarithm of the prior, with the tails of a Student's t."""
        freedom, weight = self.settings.prior_freedom, self.settings.prior_weight
        squares = [
            self._distance(h, s) ** 2 for h, s in zip(fit.hypotheses, np.atleast_1d(shares), strict=True)
        ]
        return weight * sum((freedom + 1.0) * float(np.log1p(square / freedom)) for square in squares)

    def _loss(self, fit: SetFit, robot: Comparison) -> float:
        shares = np.array([h.share(at) for h, at in zip(fit.hypotheses, robot.at.tolist(), strict=True)])
        return self.loss.total(robot.whitened) + self._prior(fit, shares)

    def _fit(
        self,
        hypotheses: tuple[Hypothesis, ...],
        robot: Comparison,
        slopes: Array,
        samples: Array,
        radius: float,
    ) -> SetFit:
        made = SetFit(hypotheses, robot, slopes, samples, 0.0, radius, self.rows)
        return replace(made, loss=self._loss(made, robot))

    def _learnt(self, fit: SetFit, tried: Iterable[tuple[Array, float, Comparison | None]]) -> SetFit:
        """Return a fit after some robots were simulated for it: at the best of them, slopes updated."""
        known = [(self._loss(fit, robot), radius, robot) for _, radius, robot in tried if robot is not None]
        if not known:
            return replace(fit, radius=self.settings.shorter * self.settings.shorter * fit.radius)
        slopes, samples = fit.slopes, fit.sample_slopes
        for _, _, robot in sorted(known, key=lambda one: -one[0]):
            slopes, samples = _updated(fit, slopes, samples, robot)
        loss, radius, robot = min(known, key=lambda one: one[0])
        learnt = replace(fit, slopes=slopes, sample_slopes=samples, measured=False)
        if loss >= fit.loss:
            return replace(learnt, radius=self.settings.shorter * min(radius, fit.radius))
        wider = min(self.settings.widest, 1.5 * radius) if radius == fit.radius else radius
        return replace(learnt, robot=robot, loss=loss, radius=wider)


def _updated(fit: SetFit, slopes: Array, samples: Array, robot: Comparison) -> tuple[Array, Array]:
    """Return slopes that also predict a simulated robot, changed as little as possible (Broyden)."""
    shares = np.array([h.share(at) for h, at in zip(fit.hypotheses, robot.at.tolist(), strict=True)])
    moved = shares - fit.shares
    size = float(moved @ moved)
    if size <= _NO_MOVE:
        return slopes, samples
    missed = robot.whitened - fit.robot.whitened - slopes @ moved
    apart = _samples(robot) - _samples(fit.robot) - samples @ moved
    return slopes + np.outer(missed, moved) / size, samples + np.outer(apart, moved) / size


def _samples(robot: Comparison) -> Array:
    return np.concatenate([robot.marker, robot.angles])


def _request(hypotheses: Sequence[Hypothesis], shares: Array) -> RobotRequest:
    """Return the robot of a set at some coordinates, in ranges."""
    return robot_request((h, h.coordinate_at(s)) for h, s in zip(hypotheses, shares.tolist(), strict=True))
