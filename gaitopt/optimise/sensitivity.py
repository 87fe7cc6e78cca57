"""How the speed of a gait changes with each of its own numbers and with each of the model's."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.statistics import half_width90
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.setup import RobotSetup

GAIT_STEP = 0.05
"""Step of a gait's number, as a share of its range."""

MODEL_STEP = 0.1
"""Step of a model's parameter, as a share of its value."""


@dataclass(frozen=True)
class Sensitivity:
    """What one number does to the mean forward speed over the same scenarios.

    Attributes:
        name: the number.
        kind: ``gait`` or ``model``.
        down, up: change of the speed a step down and a step up, m/s.
        slope: half the difference of the two, m/s a step: the central difference.
        noise: half the 90 % interval of `slope`, m/s, by its spread over the scenarios.
    """

    name: str
    kind: str
    down: float
    up: float
    slope: float
    noise: float


def sensitivities(problem: Problem, gait: Gait, seed: int, executor: Executor) -> list[Sensitivity]:
    """Return the sensitivity to each number of the gait and of the model that it has an effect on.

    Each number is moved a step down and a step up, all else as it was, in scenarios that are the same for
    all of them. A parameter of value 0 has no step, and one that the model does not stand is left out.
    """
    scenarios = scenarios_of(problem, seed, Stream.SENSITIVITY_SCENARIOS)

    def speeds(changed: Problem, gaits: Sequence[Gait]) -> NDArray[np.float64]:
        setting = RobotSetup.of(changed, scenarios, changed.simulation.working)
        rows = Evaluator(setting, executor).outcomes(gaits)
        return np.array([[outcome.metrics[SPEED.name] for outcome in row] for row in rows])

    names = [variable.name for variable in problem.space.variables]
    nominal, *moved = speeds(problem, [gait, *_moved(problem, gait)])
    found = [
        _sensitivity(name, "gait", nominal, moved[2 * i], moved[2 * i + 1]) for i, name in enumerate(names)
    ]
    for name, parameter in problem.file.parameters.items():
        changed = _changed(problem, name, parameter.value)
        if changed:
            found.append(_sensitivity(name, "model", nominal, *(speeds(one, [gait])[0] for one in changed)))
    return found


def _changed(problem: Problem, name: str, value: float) -> list[Problem]:
    """Return the problem with a parameter a step down and a step up; nothing where that cannot be."""
    if value == 0.0:
        return []
    steps = (1.0 - MODEL_STEP, 1.0 + MODEL_STEP)
    try:
        changed = [problem.with_parameters({name: value * step}) for step in steps]
        for one in changed:
            build_model(one)
    except GaitoptError:
        return []
    return changed


def _moved(problem: Problem, gait: Gait) -> list[Gait]:
    """Return the gait with each of its numbers a step down and a step up, inside the bounds."""
    point = problem.space.encode(gait)
    moved = []
    for index in range(len(point)):
        for step in (-GAIT_STEP, GAIT_STEP):
            there = point.copy()
            there[index] += step
            moved.append(problem.space.decode(there))
    return moved


def _sensitivity(
    name: str, kind: str, nominal: NDArray[np.float64], down: NDArray[np.float64], up: NDArray[np.float64]
) -> Sensitivity:
    slopes = (up - down) / 2.0
    changes = float((down - nominal).mean()), float((up - nominal).mean())
    return Sensitivity(name, kind, *changes, slope=float(slopes.mean()), noise=half_width90(slopes))
