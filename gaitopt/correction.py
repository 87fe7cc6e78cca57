"""What a correction changes: gaits of the nominal and of the corrected robot, side by side."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import asdict, dataclass

from gaitopt.errors import GaitoptError
from gaitopt.gait import Gait
from gaitopt.metrics import measure
from gaitopt.model import Robot
from gaitopt.plan import Planner, PlanSettings
from gaitopt.problem import Problem
from gaitopt.rollout import Simulator

PERIODS_S = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Periods at which the first baseline's wave is predicted."""

_ELITES = 3
_STARTS = (6, 3, 2)
"""Starts of a plan that is brief; `gaitopt optimise` makes a long one."""


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
    """Return baselines, their first wave at other periods, and planned gaits, on both robots."""
    gaits = dict(problem.baselines)
    if gaits:
        first = next(iter(gaits.values()))
        periods = {gait.period_s for gait in gaits.values()}
        gaits |= {f"{first.name} at {p:g} s": first.with_period(p) for p in PERIODS_S if p not in periods}
    gaits |= _planned(problem)
    before, after = Simulator.build(problem), Simulator.build(corrected)
    futures = {
        name: (executor.submit(_speed, before, gait), executor.submit(_speed, after, gait))
        for name, gait in gaits.items()
    }
    return [
        Walked(name, gaits[name].period_s, one.result(), other.result())
        for name, (one, other) in futures.items()
    ]


def _planned(problem: Problem) -> dict[str, Gait]:
    """Return the best planned gaits; none where the problem has no planar model."""
    if problem.file.planar is None:
        return {}
    try:
        elites = Planner(problem, PlanSettings(n_starts=_STARTS, n_elites=_ELITES)).plan().elites
    except GaitoptError:
        return {}
    return {f"planned {i + 1}": elite.gait for i, elite in enumerate(elites)}


def _speed(simulator: Simulator, gait: Gait) -> float:
    path = simulator.run(gait)
    if path.status != "ok":
        return math.nan
    return float(measure(simulator.problem, gait, path, Robot.of(simulator.models[0]))["speed_m_s"])
