"""Verification: gaits at the reference fidelity, in scenarios that the search did not see."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from gaitopt.core.statistics import interval90
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.objective import Evaluation
from gaitopt.simulation.scenario import Scenario, draw_scenarios
from gaitopt.simulation.setup import RobotSetup

_SELECTION_SCENARIOS = 8
"""Scenarios of the selection of the winner and of the sensitivities."""


@dataclass(frozen=True)
class Verified:
    """A gait over the verification scenarios.

    Attributes:
        gait: the gait.
        evaluation: mean metrics, constraints and cost.
        speeds: forward speed in each scenario, m/s, shape (n,).
        simulated_s: simulated seconds spent.
    """

    gait: Gait
    evaluation: Evaluation
    speeds: np.ndarray
    simulated_s: float

    @property
    def speed(self) -> float:
        """Mean forward speed, m/s."""
        return float(self.speeds.mean())

    @property
    def speed_ci90(self) -> tuple[float, float]:
        """90 % interval of the mean forward speed, m/s."""
        return interval90(self.speeds)

    @property
    def worst(self) -> float:
        """Lowest forward speed of any scenario, m/s."""
        return float(self.speeds.min())


def scenarios_of(problem: Problem, seed: int, stream: Stream) -> tuple[Scenario, ...]:
    """Return the scenarios of one stream of a run.

    Args:
        problem: the problem, whose file says how many and how wide.
        seed: seed of the run.
        stream: the `Stream` of these scenarios.
    """
    spread = problem.file.scenarios
    counts = {Stream.SEARCH_SCENARIOS: spread.search, Stream.VERIFICATION_SCENARIOS: spread.verification}
    return draw_scenarios(problem, counts.get(stream, _SELECTION_SCENARIOS), (seed, stream))


def verify(problem: Problem, gaits: Sequence[Gait], seed: int, executor: Executor) -> list[Verified]:
    """Return each gait at the reference fidelity over the verification scenarios.

    Args:
        problem: the problem.
        gaits: the gaits.
        seed: seed of the scenarios.
        executor: where the rollouts run.
    """
    scenarios = scenarios_of(problem, seed, Stream.VERIFICATION_SCENARIOS)
    evaluator = Evaluator(RobotSetup.of(problem, scenarios, problem.simulation.reference), executor)
    verified = []
    for gait, one in zip(gaits, evaluator(gaits), strict=True):
        speeds = np.array([outcome.metrics[SPEED.name] for outcome in one.outcomes])
        verified.append(Verified(gait, one.evaluation, speeds, one.simulated_s))
    return verified
