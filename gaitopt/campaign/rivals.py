"""Rivals of a campaign: methods that film the same robot without what it knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.campaign.course import bounded, within
from gaitopt.campaign.gaussian_process import Conditioned
from gaitopt.campaign.settings import BELIEF, BeliefSettings
from gaitopt.campaign.speeds import filmed_drifts, filmed_speed
from gaitopt.core.streams import Stream, generator
from gaitopt.core.threads import on_one_thread
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.solvers.surrogate import embedded
from gaitopt.problem.problem import Problem

Array = NDArray[np.float64]

_OFFERED = 1024
"""Gaits all over the space of which the next one is chosen, and as many near the best one."""

_NEAR = 0.1
"""Standard deviation of the latter about the best one, in units of the space."""


_LENGTH = 0.205
"""Length scale of the speed over the gait space, times the root of its number of coordinates: the mode of the
prior of Hvarfner, Hellsten and Nardi, "Vanilla Bayesian Optimization Performs Great in High Dimensions"
(2024), arXiv:2402.02229: log-normal about sqrt(2) + log(d) / 2, of standard deviation sqrt(3)."""


@dataclass(frozen=True)
class Tried:
    """A gait that a rival filmed.

    Attributes:
        gait: the gait.
        speed_m_s: its measured speed, m/s.
        drift: sideways over forward travel, left positive; 0 where it was not measured.
    """

    gait: Gait
    speed_m_s: float
    drift: float = 0.0

    @staticmethod
    def of(gait: Gait, film: Trial, problem: Problem) -> Tried:
        """Return what a film of a gait shows.

        Raises:
            GaitoptError: forward motion was not measured, or for less than one cycle.
        """
        trial = replace(film, drive=gait)
        roles, horizon = problem.roles, problem.simulation.horizon
        speed = filmed_speed(trial, roles, horizon).mean_m_s
        return Tried(gait, speed, filmed_drifts([(0, trial)], {0: speed}, roles, horizon).get(0, 0.0))


def best_of(tried: Sequence[Tried], most_drift: float) -> Tried:
    """Return the fastest gait that keeps a limit on the drift; the fastest one where none does."""
    return max(tried, key=lambda one: (abs(one.drift) <= most_drift, one.speed_m_s))


@dataclass(frozen=True)
class TrialAndError:
    """Settings of intelligent trial and error.

    Attributes:
        length: length scale of the Matérn kernel.
        optimism: standard deviations that are added to the mean.

    Both are those of Cully, Clune, Tarapore and Mouret, "Robots that can adapt like animals", Nature 521
    (2015).
    """

    length: float = 0.4
    optimism: float = 0.05


TRIAL_AND_ERROR = TrialAndError()


@on_one_thread
def bayesian_optimisation(
    space: GaitSpace,
    starts: Sequence[Gait],
    film: Callable[[Gait], Tried],
    films: int,
    seed: int,
    most_drift: float = math.inf,
    settings: BeliefSettings = BELIEF,
) -> list[Tried]:
    """Film gaits by Bayesian optimisation on the robot, without a simulator.

    A Gaussian process of the measured speed, and expected improvement: Jones, Schonlau and Welch, "Efficient
    Global Optimization of Expensive Black-Box Functions", Journal of Global Optimization 13 (1998). It counts
    with the probability that a gait keeps the limit on the drift, by a second process: Gardner et al.,
    "Bayesian Optimization with Inequality Constraints", ICML 2014.

    Args:
        space: the gait space.
        starts: gaits that are known by hand, filmed first, at most as many as half of the films.
        film: films a gait.
        films: how many films.
        seed: seed of the gaits on offer.
        most_drift: largest drift allowed.
        settings: see `BeliefSettings`.
    """
    tried: list[Tried] = []
    for number in range(films):
        if number < min(len(starts), max(1, films // 2)):
            gait = starts[number]
        else:
            gait = _next(space, tried, seed, number, most_drift, settings)
        tried.append(film(gait))
    return tried


def _next(
    space: GaitSpace,
    tried: Sequence[Tried],
    seed: int,
    number: int,
    most_drift: float,
    settings: BeliefSettings,
) -> Gait:
    """Return the gait of highest expected improvement of those on offer."""
    offered = quasi_random(space, _OFFERED, seed, Stream.CAMPAIGN_RIVALS, number)
    if not tried:
        return space.decode(offered[0], f"film-{number + 1}")
    rng = generator(seed, Stream.CAMPAIGN_RIVALS, number, 1)
    best = space.encode(best_of(tried, most_drift).gait)
    near = best + _NEAR * rng.standard_normal((_OFFERED, len(best)))
    points = np.vstack([offered, np.array([space.wrap(point) for point in near])])
    chosen = int(_improvement(points, tried, space, most_drift, settings).argmax())
    return space.decode(points[chosen], f"film-{number + 1}")


def _improvement(
    points: Array, tried: Sequence[Tried], space: GaitSpace, most_drift: float, settings: BeliefSettings
) -> Array:
    """Return by how much each point is expected to beat the best gait so far, m/s, shape (n,).

    Where no gait kept the limit on the drift yet, how probable it is that each point does.
    """
    at = embedded(np.array([space.encode(one.gait) for one in tried]), space.circular)
    wanted = embedded(points, space.circular)
    drifts = bounded(np.array([one.drift for one in tried]))
    drift, unsure = _expected(wanted, at, drifts, settings.drift, settings.drift_repeatability)
    keeps = within(drift, most_drift, unsure)
    best = best_of(tried, most_drift)
    if abs(best.drift) > most_drift:
        return keeps
    speeds = np.array([one.speed_m_s for one in tried])
    highest = float(np.abs(speeds).max())
    least, noise = max(settings.size * highest, 1e-6), settings.repeatability * highest
    speed, deviation = _expected(wanted, at, speeds, least, noise)
    above = (speed - best.speed_m_s) / deviation
    improvement: Array = deviation * (above * stats.norm.cdf(above) + stats.norm.pdf(above))
    return improvement * keeps


def _expected(wanted: Array, at: Array, values: Array, least: float, noise: float) -> tuple[Array, Array]:
    """Return mean and standard deviation of a quantity at points, both of shape (n,).

    Args:
        wanted: the points, shape (n, d).
        at: where it was measured, shape (m, d).
        values: what was measured, shape (m,).
        least: least standard deviation of the quantity over the space.
        noise: standard deviation of a measurement.
    """
    scale, length = max(float(values.std()), least), _LENGTH * math.sqrt(wanted.shape[1])
    process = Conditioned.of(wanted, at, np.full(len(at), noise**2), scale**2, length)
    mean: Array = values.mean() + process.gain @ (values - values.mean())
    return mean, np.maximum(process.deviation, 1e-9)


@on_one_thread
def trial_and_error(
    space: GaitSpace,
    archive: Sequence[Tried],
    film: Callable[[Gait], Tried],
    films: int,
    most_drift: float = math.inf,
    settings: TrialAndError = TRIAL_AND_ERROR,
    belief: BeliefSettings = BELIEF,
) -> list[Tried]:
    """Film gaits by intelligent trial and error: a map of gaits from the nominal simulator is the prior.

    The map here is every gait that the nominal search tried, in the gait space. That of the paper holds the
    best gait for each of many kinds of behaviour. A gait that drifts too far counts as one that stands.

    Args:
        space: the gait space.
        archive: gaits with their nominal speed.
        film: films a gait.
        films: how many films.
        most_drift: largest drift allowed.
        settings: see `TrialAndError`.
        belief: size of the discrepancy and of the noise.
    """
    points = embedded(np.array([space.encode(one.gait) for one in archive]), space.circular)
    prior = np.array([one.speed_m_s for one in archive])
    scale = belief.size * float(np.abs(prior).max())
    noise = belief.repeatability * float(np.abs(prior).max())
    chosen: list[int] = []
    tried: list[Tried] = []
    for _ in range(films):
        earned = [one.speed_m_s if abs(one.drift) <= most_drift else 0.0 for one in tried]
        left = np.array(earned) - prior[np.array(chosen, dtype=int)]
        noises = np.full(len(chosen), noise**2)
        process = Conditioned.of(
            points, points[np.array(chosen, dtype=int)], noises, scale**2, settings.length
        )
        hopes = prior + process.gain @ left + settings.optimism * process.deviation
        chosen.append(int(hopes.argmax()))
        tried.append(film(archive[chosen[-1]].gait))
    return tried
