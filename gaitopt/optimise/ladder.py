"""The fidelity ladder: judge gaits on a cheaper rung, where it ranks them as the working fidelity does.

What a search has to rank are neighbours of its best gait, and how well a rung does that differs from robot
to robot and from gait to gait. So it is measured in each search, on gaits that it has just judged at the
working fidelity, and a rung that ranks them otherwise is refused. ``results/profile`` has what that is worth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.simulation.setup import RobotSetup

TRUSTED = 0.9
"""Rank correlation from which a rung is used. Another start pose, which is chance, ranks ArcFold's gaits at
0.97 and the strider's at 0.4; see ``results/profile``."""

FACTOR = 2.0
"""How much longer a step, how much shorter a horizon is one rung down."""


@dataclass(frozen=True)
class Rung:
    """A cheaper way to judge gaits, and how well it ranks.

    Attributes:
        name: what is coarser than one rung up.
        timestep_s: its timestep, s.
        measured_s: how long it measures at least, s.
        rank_correlation: Spearman's, of its costs and those of the working fidelity; 0 where all are alike.
        used: whether the search went on with it.
        simulated_s: simulated seconds that this took.
    """

    name: str
    timestep_s: float
    measured_s: float
    rank_correlation: float
    used: bool
    simulated_s: float


def descended(
    evaluator: Evaluator, gaits: Sequence[Gait], costs: NDArray[np.float64]
) -> tuple[Evaluator, list[Rung]]:
    """Return the evaluator of the lowest rung that ranks as it should, and every rung that was measured.

    First a longer timestep is tried, then, wherever that has led, a shorter horizon.

    Args:
        evaluator: the working fidelity.
        gaits: neighbours of the best gait.
        costs: their costs at the working fidelity, in every scenario, shape (n,).
    """
    rungs = []
    for name, lower in _STEPS.items():
        candidate = replace(evaluator, setup=lower(evaluator.setup))
        judged = candidate(gaits)
        correlation = _spearman(costs, np.array([one.evaluation.cost for one in judged]))
        used = correlation >= TRUSTED
        spent = sum(outcome.simulated_s for one in judged for outcome in one.outcomes)
        setting = candidate.setup
        measured_s = setting.problem.simulation.horizon.measured_s
        rungs.append(Rung(name, setting.fidelity.timestep_s, measured_s, correlation, used, spent))
        evaluator = candidate if used else evaluator
    return evaluator, rungs


def coarser(setting: RobotSetup) -> RobotSetup:
    """Return a setting with a longer timestep."""
    step = {"timestep_s": FACTOR * setting.fidelity.timestep_s}
    return RobotSetup.of(setting.problem, setting.scenarios, setting.fidelity.model_copy(update=step))


def shorter(setting: RobotSetup) -> RobotSetup:
    """Return a setting with a shorter horizon, of as many whole cycles as the problem asks for at least."""
    horizon = setting.problem.simulation.horizon
    times = {"transient_s": horizon.transient_s / FACTOR, "measured_s": horizon.measured_s / FACTOR}
    problem = setting.problem.with_horizon(horizon.model_copy(update=times))
    return RobotSetup.of(problem, setting.scenarios, setting.fidelity)


_STEPS: dict[str, Callable[[RobotSetup], RobotSetup]] = {
    "longer timestep": coarser,
    "shorter horizon": shorter,
}


def _spearman(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return Spearman's rank correlation; 0 where there is nothing to rank."""
    if np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return 0.0
    return float(stats.spearmanr(one, other).statistic)
