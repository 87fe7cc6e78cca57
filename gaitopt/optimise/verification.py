"""Verification: gaits at the reference fidelity, in scenarios that the search did not see."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.core.progress import Count, OnProgress, silent
from gaitopt.core.statistics import interval90
from gaitopt.core.streams import Stream, generator
from gaitopt.effects.active import EffectValues
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.audit.settings import DEFAULT, CheckSettings
from gaitopt.simulation.metrics import SPEED, Metrics
from gaitopt.simulation.objective import Evaluation
from gaitopt.simulation.scenario import Scenario, draw_scenarios
from gaitopt.simulation.setup import RobotSetup

VERIFICATION, TIMESTEP = "verification", "verification at the search's timestep"
"""Names of stages."""

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
        rows: metrics in each scenario.
    """

    gait: Gait
    evaluation: Evaluation
    speeds: np.ndarray
    simulated_s: float
    rows: tuple[Metrics, ...] = ()

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
    """Return the scenarios of one stream of a run, each on a robot of its own where the problem has some.

    Args:
        problem: the problem, whose file says how many and how wide.
        seed: seed of the run.
        stream: the `Stream` of these scenarios.
    """
    count = _scenario_count(problem, stream)
    before = sum(_scenario_count(problem, one) for one in _IN_TURN[: _IN_TURN.index(stream)])
    return _on_robots(draw_scenarios(problem, count, (seed, stream)), problem, seed, before)


def scenarios_on_every_robot(problem: Problem, seed: int, most: int) -> tuple[Scenario, ...]:
    """Return the verification scenarios of a run, as many as the problem has robots, each on one of them.

    Args:
        problem: a problem with robots.
        seed: seed of the run.
        most: most robots; of more, so many that are spread evenly.
    """
    chosen = problem.with_robots(evenly(problem.robots, most))
    drawn = draw_scenarios(problem, len(chosen.robots), (seed, Stream.VERIFICATION_SCENARIOS))
    return _on_robots(drawn, chosen, seed, 0)


def evenly(robots: Sequence[EffectValues], most: int) -> list[EffectValues]:
    """Return all robots, or at most so many that are spread evenly over them."""
    if len(robots) <= most:
        return list(robots)
    return [robots[index * len(robots) // most] for index in range(most)]


_IN_TURN = (
    Stream.SEARCH_SCENARIOS,
    Stream.SELECTION_SCENARIOS,
    Stream.VERIFICATION_SCENARIOS,
    Stream.SENSITIVITY_SCENARIOS,
    Stream.CONFIRMATION_SCENARIOS,
)
"""The streams in the order in which they take robots: as far as there are enough, each takes others."""


def _scenario_count(problem: Problem, stream: Stream) -> int:
    spread = problem.file.scenarios
    counts = {
        Stream.SEARCH_SCENARIOS: spread.search,
        Stream.VERIFICATION_SCENARIOS: spread.verification,
        Stream.CONFIRMATION_SCENARIOS: spread.verification,
    }
    return counts.get(stream, _SELECTION_SCENARIOS)


def _on_robots(
    scenarios: Sequence[Scenario], problem: Problem, seed: int, before: int
) -> tuple[Scenario, ...]:
    """Return scenarios on the robots of a problem, in an order that the seed gives, after the first ones."""
    if not problem.robots:
        return tuple(scenarios)
    order = generator(seed, Stream.POSTERIOR_ORDER).permutation(len(problem.robots)).tolist()
    return tuple(
        replace(scenario, effects=problem.robots[order[(before + index) % len(order)]])
        for index, scenario in enumerate(scenarios)
    )


@dataclass(frozen=True)
class Convergence:
    """A gait at the working and at the reference fidelity, in the same scenarios.

    Attributes:
        working: the gait at the working fidelity.
        change_m_s: what the reference fidelity adds to its mean forward speed, m/s.
        change_ci90_m_s: 90 % interval of that, m/s.
        converged: whether the change is no larger than what `gaitopt check` allows of a baseline whose
            timestep is halved, or may be so by chance.
    """

    working: Verified
    change_m_s: float
    change_ci90_m_s: tuple[float, float]
    converged: bool


def convergence(
    problem: Problem,
    verified: Verified,
    seed: int,
    executor: Executor,
    settings: CheckSettings = DEFAULT,
    on_progress: OnProgress = silent,
) -> Convergence:
    """Return whether a verified gait owes its speed to the timestep of the search.

    Args:
        problem: the problem.
        verified: the gait at the reference fidelity.
        seed: seed of the scenarios.
        executor: where the rollouts run.
        settings: how much a speed may change.
        on_progress: called after each rollout.
    """
    coarse = problem.simulation.working
    (working,) = verify(problem, [verified.gait], seed, executor, coarse, on_progress, TIMESTEP)
    changes = verified.speeds - working.speeds
    low, high = interval90(changes)
    limit = max(settings.timestep_change * abs(verified.speed), settings.timestep_floor_m_s)
    converged = working.evaluation.status == verified.evaluation.status and low <= limit and high >= -limit
    return Convergence(working, float(changes.mean()), (low, high), converged)


def verify(
    problem: Problem,
    gaits: Sequence[Gait],
    seed: int,
    executor: Executor,
    fidelity: Fidelity | None = None,
    on_progress: OnProgress = silent,
    stage: str = VERIFICATION,
) -> list[Verified]:
    """Return each gait over the verification scenarios.

    Args:
        problem: the problem.
        gaits: the gaits.
        seed: seed of the scenarios.
        executor: where the rollouts run.
        fidelity: how finely; the reference by default.
        on_progress: called after each rollout.
        stage: what this is, in words.
    """
    scenarios = scenarios_of(problem, seed, Stream.VERIFICATION_SCENARIOS)
    fidelity = fidelity or problem.simulation.reference
    count = Count(on_progress, stage, len(gaits) * len(scenarios), "rollouts")
    evaluator = Evaluator(RobotSetup.of(problem, scenarios, fidelity), executor, on_done=count.one)
    verified = []
    for gait, one in zip(gaits, evaluator(gaits), strict=True):
        speeds = np.array([outcome.metrics[SPEED.name] for outcome in one.outcomes])
        rows = tuple(outcome.metrics for outcome in one.outcomes)
        verified.append(Verified(gait, one.evaluation, speeds, one.simulated_s, rows))
    return verified
