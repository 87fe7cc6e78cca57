"""How the speed of a gait changes with each of its own numbers and with each of the model's."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import Count, OnProgress, silent
from gaitopt.core.statistics import half_width90
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.setup import RobotSetup

SENSITIVITIES = "sensitivities"
"""Name of the stage."""


@dataclass(frozen=True)
class SensitivitySettings:
    """How far numbers are moved.

    Attributes:
        gait_step: step of a number of the gait, as a share of its range.
        model_step: step of a parameter of the model, as a share of its value.
    """

    gait_step: float = 0.05
    model_step: float = 0.1


@dataclass(frozen=True)
class Sensitivity:
    """How one number changes the mean forward speed over the same scenarios.

    Attributes:
        name: the number.
        kind: ``gait`` or ``model``.
        down, up: change of the speed a step down and a step up, m/s.
        slope: half the difference of the two (the central difference), m/s a step.
        noise: half the width of the 90 % interval of `slope`, m/s, from its spread over the scenarios.
    """

    name: str
    kind: str
    down: float
    up: float
    slope: float
    noise: float


def sensitivities(
    problem: Problem,
    gait: Gait,
    seed: int,
    executor: Executor,
    settings: SensitivitySettings = SensitivitySettings(),
    on_progress: OnProgress = silent,
) -> list[Sensitivity]:
    """Return the sensitivity of the speed to each number of the gait and to each parameter of the model.

    Each number is moved by itself, a step down and a step up, in the same scenarios. A parameter of value 0
    has no step. One with which the model cannot be built is left out.

    Args:
        problem: the problem.
        gait: the gait.
        seed: seed of the scenarios.
        executor: where the rollouts run.
        settings: how far numbers are moved.
        on_progress: called after each rollout.
    """
    scenarios = scenarios_of(problem, seed, Stream.SENSITIVITY_SCENARIOS)

    def speeds(changed: Problem, gaits: Sequence[Gait]) -> NDArray[np.float64]:
        setup = RobotSetup.of(changed, scenarios, changed.simulation.working)
        rows = Evaluator(setup, executor, on_done=count.one).outcomes(gaits)
        return np.array([[outcome.metrics[SPEED.name] for outcome in row] for row in rows])

    names = [variable.name for variable in problem.space.variables]
    parameters = {
        name: _changed(problem, name, parameter.value, settings.model_step)
        for name, parameter in problem.file.parameters.items()
    }
    robots = 1 + 2 * len(names) + sum(map(len, parameters.values()))
    count = Count(on_progress, SENSITIVITIES, robots * len(scenarios), "rollouts")
    nominal, *moved = speeds(problem, [gait, *_moved(problem, gait, settings.gait_step)])
    found = [
        _sensitivity(name, "gait", nominal, moved[2 * i], moved[2 * i + 1]) for i, name in enumerate(names)
    ]
    for name, changed in parameters.items():
        if changed:
            found.append(_sensitivity(name, "model", nominal, *(speeds(one, [gait])[0] for one in changed)))
    return found


def _changed(problem: Problem, name: str, value: float, step: float) -> list[Problem]:
    """Return the problem with a parameter a step down and a step up; nothing where it cannot be built."""
    if value == 0.0:
        return []
    try:
        changed = [problem.with_parameters({name: value * factor}) for factor in (1.0 - step, 1.0 + step)]
        for one in changed:
            build_model(one)
    except GaitoptError:
        return []
    return changed


def _moved(problem: Problem, gait: Gait, step: float) -> list[Gait]:
    """Return the gait with each of its numbers a step down and a step up, inside the bounds."""
    point = problem.space.encode(gait)
    moved = []
    for index in range(len(point)):
        for move in (-step, step):
            there = point.copy()
            there[index] += move
            moved.append(problem.space.decode(there))
    return moved


def _sensitivity(
    name: str, kind: str, nominal: NDArray[np.float64], down: NDArray[np.float64], up: NDArray[np.float64]
) -> Sensitivity:
    slopes = (up - down) / 2.0
    changes = float((down - nominal).mean()), float((up - nominal).mean())
    return Sensitivity(name, kind, *changes, slope=float(slopes.mean()), noise=half_width90(slopes))
