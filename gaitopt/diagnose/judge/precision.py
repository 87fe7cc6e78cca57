"""How well a parameter is known: by what nobody knows of the robot, and by what the trials say.

A candidate's robot is perturbed: other start poses, masses, hinges and numerics. Had one of these robots
been measured in its place, the fit would have ended elsewhere. How far it moves is one part of a parameter's
error. The covariance may be estimated from the same robots; what still moves the fit it cannot explain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.core.streams import Stream
from gaitopt.diagnose.fit import response
from gaitopt.diagnose.fit.fitting import Comparison, Fit, TrialSet, compare_robot
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.pairs import PairFit
from gaitopt.diagnose.fit.response import Response
from gaitopt.diagnose.judge.evidence import TEMPER, Candidate
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

_DRAWS = 8
_TAIL = 0.95
_LIKELY = 2.71
"""Loss by which a parameter's 90 % interval ends, in units of one tempered square."""

_JUMPED = 0.5
"""Share of a jump of the response by which a fit may be off: nine in ten of fifty intervals covered."""


@dataclass(frozen=True)
class PerturbedRobots:
    """Robots drawn about a candidate, those left out that the simulator could not finish.

    Attributes:
        points: the trials beside each.
        changes: how each changes the whitened residual, shape (draws, rows).
    """

    comparisons: tuple[Comparison, ...]
    changes: Array


def perturbed_about(
    trial_set: TrialSet, candidate: Candidate, executor: Executor, seed: int
) -> PerturbedRobots:
    """Return robots drawn about a candidate.

    Args:
        trial_set: the trials.
        candidate: the candidate.
        executor: where robots are simulated.
        seed: seed of the draws.
    """
    problem = trial_set.problem.with_effects(candidate.effect_values)
    simulator = Simulator.build(problem, fidelity=trial_set.simulator.fidelity)
    robots = [simulator, *perturbed_robots(simulator, seed, _DRAWS, Stream.PRECISION_ROBOTS)]
    futures = [
        executor.submit(compare_robot, trial_set, robot, f"drawn {index}: {candidate.effect_values!r}")
        for index, robot in enumerate(robots)
    ]
    centre, *others = [future.result() for future in futures]
    points = tuple(point for point in others if point is not None and centre is not None)
    changes = [point.whitened - centre.whitened for point in points if centre is not None]
    return PerturbedRobots(points, np.array(changes).reshape(len(changes), len(trial_set.blocks)))


def intervals(candidate: Candidate, trial_set: TrialSet, drawn: Array) -> list[tuple[float, float]]:
    """Return a 90 % interval of each parameter, in its unit.

    Its half-width is what drawn robots shift the fit by, by Student's t, and what the tempered likelihood
    allows, added in quadrature.

    Args:
        candidate: the candidate.
        trial_set: the trials.
        drawn: changes of the whitened residual with robots perturbed about the first candidate, shape
            (draws, rows).
    """
    rows = drawn.shape[1]
    usual = max(1.0, float(np.sum(drawn**2)) / max(drawn.size, 1))
    unit = TEMPER * max(1.0, float(candidate.seen.sum()) / rows / usual)
    both = np.concatenate([drawn, -drawn])  # an error is as likely as its opposite
    if candidate.pair is not None:
        return _pair_intervals(candidate.pair, candidate.at, both, unit)
    return [_interval(fit, both, unit) for fit in candidate.fits]


def excludes_none(candidate: Candidate, trial_set: TrialSet, drawn: Array) -> bool:
    """Whether no parameter's interval reaches the value at which its effect does nothing."""
    found = zip(candidate.fits, intervals(candidate, trial_set, drawn), strict=True)
    neutral = [(fit.hypothesis.value(fit.hypothesis.neutral), ends) for fit, ends in found]
    return not any(low <= value <= high for value, (low, high) in neutral)


def _interval(fit: Fit, drawn: Array, unit: float) -> tuple[float, float]:
    """Return an interval whose sides may differ: where the loss is flat on one side, it reaches far there."""
    curve, h = fit.curve, fit.hypothesis
    total = curve.losses.sum(axis=0)
    best = float(curve.at[np.argmin(total)])
    shifted = np.array([curve.at[np.argmin(total + 2.0 * fit.product(row))] for row in drawn]) - best
    likely = curve.at[total <= total.min() + _LIKELY * unit] - best
    even = (h.high - h.low) * float(_half_widths(response.of_fit(fit), drawn, unit)[0])
    sides = []
    for side in (-1.0, 1.0):
        reach = _reach(side * shifted)
        uneven = math.hypot(reach, float(max(0.0, (side * likely).max())))
        sides.append(best + side * max(even, uneven))
    return _values(h, sides)


def _values(h: Hypothesis, sides: Sequence[float]) -> tuple[float, float]:
    """Return the parameter at both ends of an interval, which a range may cut off."""
    low, high = sorted(h.value(min(max(at, h.low), h.high)) for at in sides)
    return low, high


def _reach(shifted: Array) -> float:
    """Return how far a fit goes one way at most, in 19 of 20 cases, from its shifts to that side."""
    ahead = shifted[shifted >= 0.0]
    if not len(ahead):
        return 0.0
    return float(stats.t.ppf(_TAIL, max(1, len(shifted) // 2)) * np.sqrt(np.mean(ahead**2)))


def _pair_intervals(
    pair: PairFit, best: tuple[float, ...], drawn: Array, unit: float
) -> list[tuple[float, float]]:
    halves = pair.spans * _half_widths(response.of_pair(pair), drawn, unit)
    sides = zip(pair.fits, best, halves.tolist(), strict=True)
    return [_values(fit.hypothesis, (at - half, at + half)) for fit, at, half in sides]


def _half_widths(near: Response, drawn: Array, unit: float) -> Array:
    """Return each interval's half-width in ranges, the response being even but for its jumps."""
    inverse = np.linalg.pinv(near.slopes)
    reaches = [_reach(column) for column in (-drawn @ inverse.T).T]
    likely = np.sqrt((_LIKELY * unit + _JUMPED**2 * near.jump) * np.diag(inverse @ inverse.T))
    halves: Array = np.hypot(reaches, likely)
    return halves
