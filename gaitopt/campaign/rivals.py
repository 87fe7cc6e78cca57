"""Rivals of a campaign: methods that film the same robot without what it knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.campaign.gaussian_process import Conditioned
from gaitopt.campaign.settings import BELIEF, BeliefSettings
from gaitopt.core.streams import Stream, generator
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.solvers.surrogate import embedded

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
    """

    gait: Gait
    speed_m_s: float


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


def bayesian_optimisation(
    space: GaitSpace,
    starts: Sequence[Gait],
    measure: Callable[[Gait], float],
    films: int,
    seed: int,
    settings: BeliefSettings = BELIEF,
) -> list[Tried]:
    """Film gaits by Bayesian optimisation on the robot, without a simulator.

    A Gaussian process of the measured speed alone, with the length scale of the campaign's discrepancy, and
    expected improvement: Jones, Schonlau and Welch, "Efficient Global Optimization of Expensive Black-Box
    Functions", Journal of Global Optimization 13 (1998).

    Args:
        space: the gait space.
        starts: gaits that are known by hand, filmed first, at most as many as half of the films.
        measure: films a gait and returns its speed, m/s.
        films: how many films.
        seed: seed of the gaits on offer.
        settings: see `BeliefSettings`.
    """
    tried: list[Tried] = []
    for number in range(films):
        if number < min(len(starts), max(1, films // 2)):
            gait = starts[number]
        else:
            gait = _next(space, tried, seed, number, settings)
        tried.append(Tried(gait, measure(gait)))
    return tried


def _next(space: GaitSpace, tried: Sequence[Tried], seed: int, number: int, settings: BeliefSettings) -> Gait:
    """Return the gait of highest expected improvement of those on offer."""
    offered = quasi_random(space, _OFFERED, seed, Stream.CAMPAIGN_RIVALS, number)
    if not tried:
        return space.decode(offered[0], f"film-{number + 1}")
    rng = generator(seed, Stream.CAMPAIGN_RIVALS, number, 1)
    at = np.array([space.encode(one.gait) for one in tried])
    speeds = np.array([one.speed_m_s for one in tried])
    near = at[speeds.argmax()] + _NEAR * rng.standard_normal((_OFFERED, at.shape[1]))
    points = np.vstack([offered, np.array([space.wrap(point) for point in near])])
    chosen = int(_improvement(points, at, speeds, space.circular, settings).argmax())
    return space.decode(points[chosen], f"film-{number + 1}")


def _improvement(
    points: NDArray[np.float64],
    at: NDArray[np.float64],
    speeds: NDArray[np.float64],
    circular: NDArray[np.bool_],
    settings: BeliefSettings,
) -> NDArray[np.float64]:
    """Return by how much each point is expected to beat the best speed so far, m/s, shape (n,)."""
    scale = max(float(speeds.std()), settings.size * float(np.abs(speeds).max()), 1e-6)
    noise = np.full(len(at), (settings.repeatability * float(np.abs(speeds).max())) ** 2)
    wanted, known = embedded(points, circular), embedded(at, circular)
    length = _LENGTH * math.sqrt(wanted.shape[1])
    process = Conditioned.of(wanted, known, noise, scale**2, length)
    mean = speeds.mean() + process.gain @ (speeds - speeds.mean())
    deviation = np.maximum(process.deviation, 1e-9)
    above = (mean - speeds.max()) / deviation
    found: NDArray[np.float64] = deviation * (above * stats.norm.cdf(above) + stats.norm.pdf(above))
    return found


def trial_and_error(
    space: GaitSpace,
    archive: Sequence[Tried],
    measure: Callable[[Gait], float],
    films: int,
    settings: TrialAndError = TRIAL_AND_ERROR,
    belief: BeliefSettings = BELIEF,
) -> list[Tried]:
    """Film gaits by intelligent trial and error: a map of gaits from the nominal simulator is the prior.

    The map here is every gait that the nominal search tried, in the gait space. That of the paper holds the
    best gait for each of many kinds of behaviour.

    Args:
        space: the gait space.
        archive: gaits with their nominal speed.
        measure: films a gait and returns its speed, m/s.
        films: how many films.
        settings: see `TrialAndError`.
        belief: size of the discrepancy and of the noise.
    """
    points = embedded(np.array([space.encode(one.gait) for one in archive]), space.circular)
    prior = np.array([one.speed_m_s for one in archive])
    scale = belief.size * float(np.abs(prior).max())
    noise = belief.repeatability * float(np.abs(prior).max())
    chosen: list[int] = []
    speeds: list[float] = []
    for _ in range(films):
        left = np.array(speeds) - prior[np.array(chosen, dtype=int)]
        noises = np.full(len(chosen), noise**2)
        process = Conditioned.of(
            points, points[np.array(chosen, dtype=int)], noises, scale**2, settings.length
        )
        hopes = prior + process.gain @ left + settings.optimism * process.deviation
        chosen.append(int(hopes.argmax()))
        speeds.append(measure(archive[chosen[-1]].gait))
    return [Tried(archive[index].gait, speed) for index, speed in zip(chosen, speeds, strict=True)]
