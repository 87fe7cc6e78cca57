"""The trials compared with perturbed robots: the changes by small unknown errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.effects.active import Values
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class PerturbedRobots:
    """Robots perturbed about a candidate; those that could not be simulated are left out.

    Attributes:
        comparisons: the trials compared with each.
        changes: change of the whitened residual with each, shape (robots, rows).
        numbers: the number of each among those drawn, from 0.
    """

    comparisons: tuple[Comparison, ...]
    changes: NDArray[np.float64]
    numbers: tuple[int, ...]


Perturb = Callable[[TrialSet, Candidate, Context], PerturbedRobots]
"""Returns the robots perturbed about a candidate."""

Draw = Callable[[Simulator], Sequence[Simulator]]
"""Draws robots about one."""


def perturbed_about(trial_set: TrialSet, candidate: Candidate, context: Context) -> PerturbedRobots:
    """Return robots perturbed about a candidate, compared with the trials."""
    count, errors = context.settings.precision.robots, context.settings.small_errors

    def draw(centre: Simulator) -> Sequence[Simulator]:
        return perturbed_robots(centre, context.seed, count, Stream.PRECISION_ROBOTS, errors)

    return compared_about(trial_set, candidate.effect_values, "drawn", draw, context)


def compared_about(
    trial_set: TrialSet,
    effects: Mapping[str, Values],
    label: str,
    draw: Draw,
    context: Context,
) -> PerturbedRobots:
    """Return robots drawn about one with some effects, compared with the trials.

    Args:
        trial_set: the trials.
        effects: the effects of that robot.
        label: a name for what is drawn: results are kept by it.
        draw: draws the robots.
        context: simulates them.
    """
    problem = trial_set.problem.with_effects(effects)
    simulator = Simulator.build(problem, fidelity=trial_set.simulator.fidelity)
    robots = [simulator, *draw(simulator)]
    named = {f"{label} {index}: {effects!r}": robot for index, robot in enumerate(robots)}
    centre, *others = context.runner.compare_robots(trial_set, named)
    pairs = [(i, other) for i, other in enumerate(others) if other is not None and centre is not None]
    changes = [other.whitened - centre.whitened for _, other in pairs if centre is not None]
    rows = len(trial_set.row_blocks)
    known = tuple(other for _, other in pairs)
    return PerturbedRobots(known, np.array(changes).reshape(len(changes), rows), tuple(i for i, _ in pairs))
