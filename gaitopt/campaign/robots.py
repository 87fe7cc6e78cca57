"""The robots of a campaign: those of the posterior, and before any film those that effects make plausible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.effects.active import EffectValue, EffectValues
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator, judge
from gaitopt.optimise.verification import evenly, scenarios_on_every_robot
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.objective import Quantile
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import HARMLESS, SIDEWAYS, SIDEWAYS_RATIO, SPEED
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.setup import RobotSetup

_TRIED = 32
"""Values of an effect of which one is drawn by its prior density."""


def prior_robots(problem: Problem, count: int, effects: tuple[int, int], seed: int) -> list[EffectValues]:
    """Return robots as they are plausible before any film.

    Args:
        problem: the problem.
        count: how many robots.
        effects: fewest and most effects of a robot.
        seed: seed of the draws.
    """
    known = [
        one
        for one in hypotheses(nominal_parts(problem), problem.channel_names, offset_known=False)
        if one.effect.changes_robot and one.effect.name not in problem.file.effects
    ]
    names = list(dict.fromkeys(one.effect.name for one in known))
    if not names:
        return [()] * count
    rng = generator(seed, Stream.CAMPAIGN_ROBOTS)
    robots = []
    for _ in range(count):
        most = min(int(rng.integers(effects[0], effects[1] + 1)), len(names))
        chosen = rng.choice(len(names), most, replace=False).tolist()
        robots.append(
            tuple(_drawn([h for h in known if h.effect.name == names[index]], rng) for index in chosen)
        )
    return robots


def _drawn(targets: Sequence[Hypothesis], rng: np.random.Generator) -> EffectValue:
    """Return an effect on one of its targets, with a value drawn from its prior within its range."""
    one = targets[int(rng.integers(len(targets)))]
    tried = rng.uniform(one.low, one.high, _TRIED)
    density = np.array([one.log_prior(coordinate) for coordinate in tried.tolist()])
    chances = np.exp(density - density.max())
    coordinate = float(rng.choice(tried, p=chances / chances.sum()))
    return EffectValue(one.effect.name, one.target, one.value(coordinate))


@dataclass(frozen=True)
class Walked:
    """Gaits on robots.

    Attributes:
        speeds: forward speed of each gait on each robot, m/s, shape (robots, gaits); 0 where a simulation
            failed.
        sideways: sideways speed, left positive, likewise.
        harms: whether it breaks a limit that guards the robot there, or failed, shape (robots, gaits).
        strays: whether it breaks another limit than that on sideways motion, likewise (`HARMLESS`).
    """

    speeds: NDArray[np.float64]
    sideways: NDArray[np.float64]
    harms: NDArray[np.bool_]
    strays: NDArray[np.bool_]


def own_scenarios(
    problem: Problem, robots: Sequence[EffectValues], seed: int, most: int, errors: bool
) -> tuple[Scenario, ...]:
    """Return a scenario of each robot: its start pose, and with `errors` small errors of everything.

    A posterior already has what is off in friction and servos; before any film, nothing has.

    Args:
        problem: the problem.
        robots: the robots.
        seed: seed of start poses and errors.
        most: most robots; of more, so many that are spread evenly.
        errors: whether robots have small errors, too.
    """
    if errors:
        return scenarios_on_every_robot(problem.with_robots(robots), seed, most)
    size = problem.file.tolerances.start_pose_rad
    chosen = evenly(robots, most)
    poses = generator(seed, Stream.CAMPAIGN_ROBOTS, 1).integers(2**31, size=len(chosen)).tolist()
    return tuple(
        Scenario(start_pose_rad=size, pose_seed=pose, effects=robot)
        for robot, pose in zip(chosen, poses, strict=True)
    )


def evaluator_on(
    problem: Problem, scenarios: Sequence[Scenario], executor: Executor, margin: float = 0.0
) -> Evaluator:
    """Return what judges gaits on robots at the working fidelity."""
    return Evaluator(RobotSetup.of(problem, scenarios, problem.simulation.working), executor, margin)


def walked(
    problem: Problem, gaits: Sequence[Gait], scenarios: Sequence[Scenario], executor: Executor
) -> Walked:
    """Simulate gaits on robots.

    Args:
        problem: the problem.
        gaits: the gaits.
        scenarios: the robots; see `own_scenarios`.
        executor: where the rollouts run.
    """
    rows = evaluator_on(problem, scenarios, executor).outcomes(gaits)
    limits = problem.objective.constraints
    guards = _limited_by(problem, [name for name in limits if name not in HARMLESS])
    others = _limited_by(problem, [name for name in limits if name in HARMLESS and name != SIDEWAYS_RATIO])

    def of(metric: str) -> NDArray[np.float64]:
        values = np.array([[one.metrics[metric] for one in row] for row in rows]).T
        return np.where(np.isfinite(values), values, 0.0)

    def broken(limited: Problem) -> NDArray[np.bool_]:
        return np.array([[not judge(limited, [one]).constraints_met for one in row] for row in rows]).T

    return Walked(of(SPEED.name), of(SIDEWAYS), broken(guards), broken(others))


def _limited_by(problem: Problem, names: Sequence[str]) -> Problem:
    """Return a problem with some of its limits alone."""
    limits = {name: problem.objective.constraints[name] for name in names}
    return _with_objective(problem, {"constraints": limits})


def judged_by_shares(problem: Problem, breaking: float, slower: float | None) -> Problem:
    """Return the problem with gaits judged by shares of the robots.

    Args:
        problem: the problem.
        breaking: share of the robots that may break each limit that guards the robot. Others are judged as
            the file says: whether a gait keeps them is seen in its film.
        slower: share of them that may be slower than a gait's speed says; None for as its file says.
    """
    rule = {"over_scenarios": Quantile(quantile=breaking)}
    limits = {
        name: limit if name in HARMLESS else limit.model_copy(update=rule)
        for name, limit in problem.objective.constraints.items()
    }
    judged = {} if slower is None else {"over_scenarios": Quantile(quantile=slower)}
    return _with_objective(problem, {"constraints": limits, **judged})


def _with_objective(problem: Problem, update: Mapping[str, object]) -> Problem:
    objective = problem.objective.model_copy(update=update)
    return replace(problem, file=problem.file.model_copy(update={"objective": objective}))
