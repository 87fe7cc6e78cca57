"""The corrected robot: its trials and its gaits, compared with those of the nominal one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.align import Aligned, align
from gaitopt.diagnose.gap.predict import predict
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.solution import Box
from gaitopt.optimise.solvers.solver import Minimisation
from gaitopt.plan.plan import Planner, PlanSettings
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup


@dataclass(frozen=True)
class CorrectionSettings:
    """How gaits for the corrected robot are searched: briefly; `gaitopt optimise` searches longer.

    Attributes:
        periods_s: periods at which the first baseline's wave is predicted, s.
        plan: how many starts of the plan, and how many of its gaits start a search; see `PlanSettings`.
        gaits: gaits of one search; 0 for no search.
        spread: first standard deviation of a search, in units of the gait space.
        seed: seed of the searches.
    """

    periods_s: tuple[float, ...] = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
    plan: PlanSettings = field(default_factory=lambda: PlanSettings(n_starts=(6, 3, 2), n_elites=3))
    gaits: int = 40
    spread: float = 0.05
    seed: int = 1


DEFAULT = CorrectionSettings()
"""The settings if none are given; tests of the command line replace them by a shorter search."""


@dataclass(frozen=True)
class Walked:
    """One gait on both robots.

    Attributes:
        name: what the report calls it.
        period_s: its period, s.
        nominal_m_s, corrected_m_s: forward speeds, m/s; NaN where the simulation fails.
    """

    name: str
    period_s: float
    nominal_m_s: float
    corrected_m_s: float

    def to_dict(self) -> dict[str, float | str]:
        """Return a row of ``corrected`` in ``diagnosis.json``."""
        return asdict(self)


@dataclass(frozen=True)
class Correction:
    """What an explanation changes, blamed or not; see `correct`.

    Attributes:
        problem: the problem with its effects switched on.
        trials: the trials compared with the corrected robot; none if not requested, or if it cannot be
            simulated.
        walked: gaits on both robots; none if not requested.
    """

    problem: Problem
    trials: tuple[Aligned, ...] = ()
    walked: tuple[Walked, ...] = ()


def correct(
    problem: Problem,
    diagnosis: Diagnosis,
    executor: Executor | None = None,
    settings: CorrectionSettings | None = None,
) -> Correction | None:
    """Return the robot with the explanation that corrects it, or with the most probable one where none does.

    It is None where no explanation was fitted.

    Args:
        problem: the nominal problem.
        diagnosis: the diagnosis.
        executor: where its trials and its gaits are simulated; None to leave them out.
        settings: how gaits are looked for; `DEFAULT` where it is None.
    """
    chosen = diagnosis.correction_or_best
    if chosen is None:
        return None
    corrected = problem.with_effects(chosen.effect_values)
    if executor is None:
        return Correction(corrected)
    walked = walked_gaits(problem, corrected, executor, settings or DEFAULT)
    return Correction(corrected, _beside(corrected, diagnosis, executor), tuple(walked))


def _beside(corrected: Problem, diagnosis: Diagnosis, executor: Executor) -> tuple[Aligned, ...]:
    """Return the trials compared with the corrected robot; none if it cannot be simulated."""
    trials = [gap.aligned.trial for gap in diagnosis.trials]
    try:
        predictions = predict(Simulator.build(corrected), trials, executor)
        return tuple(align(trial, simulated) for trial, simulated in zip(trials, predictions, strict=True))
    except GaitoptError:
        return ()


def walked_gaits(
    problem: Problem, corrected: Problem, executor: Executor, settings: CorrectionSettings = DEFAULT
) -> list[Walked]:
    """Return baselines, their first wave at other periods, and each robot's best gait, on both robots.

    There is no best gait without ``[gait]`` and ``[objective]``, and no speed at all without a marker.

    Args:
        problem: the nominal problem.
        corrected: the same robot corrected.
        executor: where robots are simulated.
        settings: how gaits are looked for.
    """
    if problem.roles.marker is None:
        return []
    gaits = dict(problem.baselines)
    if gaits:
        first = next(iter(gaits.values()))
        known = {gait.period_s for gait in gaits.values()}
        others = [period for period in settings.periods_s if period not in known]
        gaits |= {f"{first.name} at {period:g} s": first.with_period(period) for period in others}
    starts = [*problem.baselines.values(), *_planned(problem, settings)] if settings.gaits else []
    if starts and problem.file.gait and problem.file.objective:
        gaits["best for the nominal robot"] = _tuned(problem, starts, executor, settings)
        gaits["best for the corrected robot"] = _tuned(corrected, starts, executor, settings)
    before, after = Simulator.build(problem), Simulator.build(corrected)
    futures = {
        name: (executor.submit(_speed, before, gait), executor.submit(_speed, after, gait))
        for name, gait in gaits.items()
    }
    return [
        Walked(name, gaits[name].period_s, one.result(), other.result())
        for name, (one, other) in futures.items()
    ]


def _planned(problem: Problem, settings: CorrectionSettings) -> list[Gait]:
    """Return the best planned gaits; none where the problem has no planar model, or no plan converges."""
    if problem.file.planar is None or problem.file.gait is None:
        return []
    try:
        elites = Planner(problem, settings.plan).plan().elites
    except GaitoptError:
        return []
    return [elite.gait for elite in elites]


def _tuned(
    problem: Problem, starts: Sequence[Gait], executor: Executor, settings: CorrectionSettings
) -> Gait:
    """Return the best gait of a brief search from the best of some starts, in the nominal scenario."""
    setup = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    evaluator = Evaluator(setup, executor, problem.objective.search_margin)
    space = problem.space

    def costs(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([one.evaluation.cost for one in evaluator([space.decode(p) for p in points])])

    points = np.array([space.encode(gait) for gait in starts])
    known = costs(points)
    start = points[known.argmin()]
    rng, box = generator(settings.seed, Stream.CORRECTED_SEARCH), Box(space.circular)
    found = CmaEs().minimise(Minimisation(costs, box, start, settings.spread, settings.gaits, rng))
    return space.decode(found.x if found.cost < known.min() else start)


def _speed(simulator: Simulator, gait: Gait) -> float:
    """Return the forward speed, m/s; NaN where the simulation fails."""
    path = simulator.run(gait)
    if path.status != "ok":
        return math.nan
    return float(measure(simulator.problem, gait, path, Robot.of(simulator.models[0]))[SPEED.name])
