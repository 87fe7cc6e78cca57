"""What a correction changes: gaits of the nominal and of the corrected robot, side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream, generator
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.solvers import cma_es
from gaitopt.optimise.solvers.solution import Box
from gaitopt.plan.plan import Planner, PlanSettings
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import NOMINAL, Simulator
from gaitopt.simulation.setup import RobotSetup

PERIODS_S = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Periods at which the first baseline's wave is predicted."""

_ELITES = 3
_STARTS = (6, 3, 2)
"""Starts of a plan that is brief; `gaitopt optimise` makes a long one."""

_GAITS = 40
"""Gaits of a search that is brief, too."""

_SPREAD = 0.05
_SEED = 1


@dataclass(frozen=True)
class Walked:
    """One gait on both robots.

    Attributes:
        name: what the report calls it.
        period_s: its period, s.
        nominal_m_s, corrected_m_s: forward speeds, m/s; NaN where it cannot walk.
    """

    name: str
    period_s: float
    nominal_m_s: float
    corrected_m_s: float

    def to_dict(self) -> dict[str, float | str]:
        """Return a row of ``corrected`` in ``diagnosis.json``."""
        return asdict(self)


def walked_gaits(problem: Problem, corrected: Problem, executor: Executor) -> list[Walked]:
    """Return baselines, their first wave at other periods, and each robot's best gait, on both robots.

    There is no best gait without ``[gait]`` and ``[objective]``, and no speed at all without a marker.
    """
    if problem.roles.marker is None:
        return []
    gaits = dict(problem.baselines)
    if gaits:
        first = next(iter(gaits.values()))
        periods = {gait.period_s for gait in gaits.values()}
        gaits |= {f"{first.name} at {p:g} s": first.with_period(p) for p in PERIODS_S if p not in periods}
    starts = [*problem.baselines.values(), *_planned(problem)]
    if starts and problem.file.gait and problem.file.objective:
        gaits["best for the nominal robot"] = _tuned(problem, starts, executor)
        gaits["best for the corrected robot"] = _tuned(corrected, starts, executor)
    before, after = Simulator.build(problem), Simulator.build(corrected)
    futures = {
        name: (executor.submit(_speed, before, gait), executor.submit(_speed, after, gait))
        for name, gait in gaits.items()
    }
    return [
        Walked(name, gaits[name].period_s, one.result(), other.result())
        for name, (one, other) in futures.items()
    ]


def _planned(problem: Problem) -> list[Gait]:
    """Return the best planned gaits; none where the problem has no planar model, or no plan converges."""
    if problem.file.planar is None or problem.file.gait is None:
        return []
    try:
        elites = Planner(problem, PlanSettings(n_starts=_STARTS, n_elites=_ELITES)).plan().elites
    except GaitoptError:
        return []
    return [elite.gait for elite in elites]


def _tuned(problem: Problem, starts: Sequence[Gait], executor: Executor) -> Gait:
    """Return the best gait of a brief search from the best of some starts, in the nominal scenario."""
    setting = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    evaluator = Evaluator(setting, executor, problem.objective.search_margin)
    space = problem.space

    def costs(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([one.evaluation.cost for one in evaluator([space.decode(p) for p in points])])

    points = np.array([space.encode(gait) for gait in starts])
    known = costs(points)
    start = points[known.argmin()]
    found = cma_es.minimise(
        costs, Box(space.circular), start, _SPREAD, _GAITS, generator(_SEED, Stream.CORRECTED_SEARCH)
    )
    return space.decode(found.x if found.cost < known.min() else start)


def _speed(simulator: Simulator, gait: Gait) -> float:
    path = simulator.run(gait)
    if path.status != "ok":
        return math.nan
    return float(measure(simulator.problem, gait, path, Robot.of(simulator.models[0]))[SPEED.name])
