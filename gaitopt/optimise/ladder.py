"""The fidelity ladder: judge gaits on a cheaper rung, if it ranks them like the working fidelity.

A search has to rank neighbours of its best gait. How well a rung ranks them depends on the robot and the
gait. So each search measures it on gaits that it has just judged at the working fidelity, and refuses a rung
that ranks them differently. Later gaits are more alike, and other gaits, so a rung in use is measured again.
The gain is in ``results/profile``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Cost, Evaluator, cost_of, simulated_s
from gaitopt.simulation.setup import RobotSetup


@dataclass(frozen=True)
class Rung:
    """A cheaper way to judge gaits, and how well it ranks.

    Attributes:
        name: what is coarser than one rung up.
        timestep_s: its timestep, s.
        measured_s: shortest time over which it measures, s.
        rank_correlation: Spearman's, of its costs and those of the working fidelity; 0 where all are equal.
        used: whether the search used it from then on.
        simulated_s: simulated seconds that this took.
        after: evaluations of the search before it was measured again; 0 for the first time.
    """

    name: str
    timestep_s: float
    measured_s: float
    rank_correlation: float
    used: bool
    simulated_s: float
    after: int = 0


@dataclass(frozen=True)
class Step:
    """A step down the ladder.

    Attributes:
        name: what it makes coarser.
        lower: returns a setup that is coarser by a factor.
    """

    name: str
    lower: Callable[[RobotSetup, float], RobotSetup]


def coarser(setup: RobotSetup, factor: float) -> RobotSetup:
    """Return a setup whose timestep is longer by a factor."""
    return RobotSetup.of(setup.problem, setup.scenarios, setup.fidelity.scaled(factor))


def shorter(setup: RobotSetup, factor: float) -> RobotSetup:
    """Return a setup whose horizon is shorter by a factor, with at least the problem's whole cycles."""
    horizon = setup.problem.simulation.horizon
    times = {"transient_s": horizon.transient_s / factor, "measured_s": horizon.measured_s / factor}
    problem = setup.problem.with_horizon(horizon.model_copy(update=times))
    return RobotSetup.of(problem, setup.scenarios, setup.fidelity)


@dataclass(frozen=True)
class LadderSettings:
    """When a cheaper rung may judge gaits.

    Attributes:
        from_gaits: budget of a stage from which cheaper rungs are measured. That costs at most as much as
            15 gaits.
        trusted: rank correlation from which a rung is used. Another start pose, which is chance, ranks
            ArcFold's gaits at 0.97 and the strider's at 0.4; see ``results/profile``.
        every: after so many populations a rung in use is measured again, and left for good where it ranks
            gaits differently by then.
        factor: how much longer the timestep and how much shorter the horizon is one rung down.
        climbers: best gaits of a lower rung that are evaluated again at the working fidelity.
        steps: the steps down, in the order in which they are tried.
    """

    from_gaits: int = 300
    trusted: float = 0.9
    every: int = 10
    factor: float = 2.0
    climbers: int = 5
    steps: tuple[Step, ...] = (Step("longer timestep", coarser), Step("shorter horizon", shorter))


@dataclass(frozen=True)
class Descent:
    """The result of the ladder.

    Attributes:
        evaluator: the evaluator of the lowest rung that may be used.
        rungs: every rung that was measured.
    """

    evaluator: Evaluator
    rungs: list[Rung]


def descend(
    evaluator: Evaluator,
    gaits: Sequence[Gait],
    costs: NDArray[np.float64],
    settings: LadderSettings = LadderSettings(),
    aim: Cost = cost_of,
) -> Descent:
    """Measure cheaper rungs, and return the lowest one that ranks gaits like the working fidelity.

    Each step starts from the last rung that may be used.

    Args:
        evaluator: the working fidelity.
        gaits: neighbours of the best gait.
        costs: their costs at the working fidelity, in every scenario, shape (n,).
        settings: when a rung may be used.
        aim: what the costs are of an evaluation.
    """
    rungs = []
    for step in settings.steps:
        candidate = replace(evaluator, setup=step.lower(evaluator.setup, settings.factor))
        rungs.append(measured(step.name, candidate, gaits, costs, settings, aim))
        evaluator = candidate if rungs[-1].used else evaluator
    return Descent(evaluator, rungs)


def measured(
    name: str,
    candidate: Evaluator,
    gaits: Sequence[Gait],
    costs: NDArray[np.float64],
    settings: LadderSettings,
    aim: Cost,
    after: int = 0,
) -> Rung:
    """Return how well a cheaper rung ranks gaits.

    Args:
        name: what is coarser on it.
        candidate: its evaluator.
        gaits: the gaits.
        costs: their costs at the working fidelity, shape (n,).
        settings: when it may be used.
        aim: what the costs are of an evaluation.
        after: evaluations of the search before.
    """
    judged = candidate(gaits)
    correlation = _spearman(costs, np.array([aim(one.evaluation) for one in judged]))
    step_s = candidate.setup.fidelity.timestep_s
    measured_s = candidate.setup.problem.simulation.horizon.measured_s
    used = correlation >= settings.trusted
    return Rung(name, step_s, measured_s, correlation, used, simulated_s(judged), after)


def _spearman(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return Spearman's rank correlation; 0 where there is nothing to rank."""
    if np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return 0.0
    return float(stats.spearmanr(one, other).statistic)
