"""Do the joints move otherwise with a shorter timestep? Servos that are stiff for the timestep do."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.audit.finding import TIMESTEP_CONVERGENCE, Finding
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario

_FINER = 4
"""The timestep is compared with this fraction of it: as far as the drafted reference fidelity lies."""

_FINEST = 8
"""The shortest timestep that is tried has this fraction of the working one."""


@dataclass(frozen=True)
class _Coarse:
    """A gait that moves otherwise: by what share of its travel, and the timestep with which it does not."""

    gait: str
    share: float
    timestep_s: float


def check_motion(
    problem: Problem, executor: Executor, settings: CheckSettings, diverged: Collection[str]
) -> Iterator[Finding]:
    """Play each baseline at the working timestep and at a quarter of it, and compare the servos' angles.

    Where start poses next to the first change the angles as much, the gait is irregular, and the timestep is
    not the cause. One finding says which gait differs most, and the longest timestep that serves all.
    """
    working = problem.simulation.working
    spread, count = settings.motion_nudge_rad, settings.motion_nudges
    nudges = [Scenario(start_pose_rad=spread, pose_seed=i) for i in range(count)]
    coarse = Simulator.build(problem, (NOMINAL, *nudges), working)
    gaits = [gait for gait in problem.baselines.values() if gait.name not in diverged]
    steps = [_FINEST * coarse.duration(gait) / working.timestep_s for gait in gaits]
    gaits = [gait for gait, most in zip(gaits, steps, strict=True) if most <= settings.motion_step_budget]
    scenarios = range(count + 1)
    jobs = [(gait, scenario) for gait in gaits for scenario in scenarios]
    runs = executor.map(coarse.run, [gait for gait, _ in jobs], [scenario for _, scenario in jobs])
    by_gait = [[next(runs) for _ in scenarios] for _ in gaits]
    found = []
    finer = executor.map(_at(coarse, _FINER).run, gaits)
    for gait, (run, *others), fine in zip(gaits, by_gait, finer, strict=True):
        irregular = float(np.mean([_apart(problem, other, run) for other in others]))
        apart = _apart(problem, run, fine)
        if apart > max(settings.motion_change, settings.motion_ratio * irregular):
            found.append(_Coarse(gait.name, apart, _enough(problem, coarse, gait, fine, settings)))
    if found:
        yield _finding(problem, found, settings)


def _finding(problem: Problem, found: Sequence[_Coarse], settings: CheckSettings) -> Finding:
    worst, timestep = max(found, key=lambda one: one.share), problem.simulation.working.timestep_s
    best = min(one.timestep_s for one in found)
    shortest_tried = best < timestep / _FINER  # nothing was compared with it
    less = " or less" if shortest_tried else ""
    message = (
        f"with a timestep of {timestep:g} s the servos' angles are off by {worst.share:.1%} of their travel "
        f"against {timestep / _FINER:g} s: take {best:g} s{less}"
    )
    return Finding(TIMESTEP_CONVERGENCE.name, worst.gait, worst.share, settings.motion_change, message)


def _enough(
    problem: Problem, coarse: Simulator, gait: Gait, finer: Trajectory, settings: CheckSettings
) -> float:
    """Return the longest timestep at which motion no longer depends on it, s, or the shortest tried."""
    timestep = coarse.fidelity.timestep_s
    finest = _at(coarse, _FINEST).run(gait)
    if _apart(problem, finer, finest) > settings.motion_change:
        return timestep / _FINEST
    halved = _at(coarse, 2).run(gait)
    return timestep / (2 if _apart(problem, halved, finest) <= settings.motion_change else _FINER)


def _at(coarse: Simulator, divisor: int) -> Simulator:
    return coarse.at(coarse.fidelity.scaled(1.0 / divisor))


def _apart(problem: Problem, run: Trajectory, other: Trajectory) -> float:
    """Return the RMS difference of the servos' angles over the RMS of their motion; inf where one fails."""
    if run.status != "ok" or other.status != "ok":
        return float("inf")
    names = [f"position.{name}" for name in problem.channel_names]
    off = [np.mean((run[name] - np.interp(run.time, other.time, other[name])) ** 2) for name in names]
    moved = float(np.mean([np.var(other[name]) for name in names]))
    return float(np.sqrt(np.mean(off) / moved)) if moved else 0.0
