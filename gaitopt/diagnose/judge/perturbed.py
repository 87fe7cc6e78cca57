"""The trials compared with perturbed robots: the changes by small unknown errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class PerturbedRobots:
    """Robots perturbed about a candidate; those that could not be simulated are left out.

    Attributes:
        comparisons: the trials compared with each.
        changes: change of the whitened residual with each, shape (robots, rows).
    """

    comparisons: tuple[Comparison, ...]
    changes: NDArray[np.float64]


Perturb = Callable[[TrialSet, Candidate, Context], PerturbedRobots]
"""Returns the robots perturbed about a candidate."""


def perturbed_about(trial_set: TrialSet, candidate: Candidate, context: Context) -> PerturbedRobots:
    """Return robots perturbed about a candidate, compared with the trials."""
    values, settings = candidate.effect_values, context.settings
    problem = trial_set.problem.with_effects(values)
    simulator = Simulator.build(problem, fidelity=trial_set.simulator.fidelity)
    count, errors = settings.precision.robots, settings.small_errors
    robots = [
        simulator,
        *perturbed_robots(simulator, context.seed, count, Stream.PRECISION_ROBOTS, errors),
    ]
    named = {f"drawn {index}: {values!r}": robot for index, robot in enumerate(robots)}
    centre, *others = context.runner.compare_robots(trial_set, named)
    known = tuple(other for other in others if other is not None and centre is not None)
    changes = [other.whitened - centre.whitened for other in known if centre is not None]
    rows = len(trial_set.row_blocks)
    return PerturbedRobots(known, np.array(changes).reshape(len(changes), rows))
