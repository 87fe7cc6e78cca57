"""Do the joints move otherwise with a shorter timestep? Servos that are stiff for the timestep do."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.audit.finding import TIMESTEP_CONVERGENCE, Finding
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

_FINER = 4
"""The timestep is compared with this fraction of it: as far as the drafted reference fidelity lies."""

_FINEST = 8
"""The shortest timestep that is tried has this fraction of the working one."""


_CHAOTIC = 2.0
"""A change by less than this many times that of a nudged start is not the timestep's."""


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

    A gait whose angles differ as much from a start pose next to it is chaotic: its timestep is not the cause.
    One finding says the gait that differs most, and the longest timestep that serves all.
    """
    working = problem.simulation.working
    coarse = Simulator.build(problem, (Scenario(),), working)
    nudged = Simulator.build(problem, (Scenario(start_pose_rad=settings.nudge_rad, pose_seed=1),), working)
    gaits = [gait for gait in problem.baselines.values() if gait.name not in diverged]
    runs = zip(gaits, executor.map(coarse.run, gaits), executor.map(nudged.run, gaits), strict=True)
    steady = [
        (gait, run, chaos)
        for gait, run, other in runs
        if (chaos := _apart(problem, other, run)) <= settings.motion_chaos
    ]
    finer = executor.map(_at(coarse, _FINER).run, [gait for gait, _, _ in steady])
    found = [
        _Coarse(gait.name, apart, _enough(problem, coarse, gait, fine, settings))
        for (gait, run, chaos), fine in zip(steady, finer, strict=True)
        if (apart := _apart(problem, run, fine)) > max(settings.motion_change, _CHAOTIC * chaos)
    ]
    if found:
        yield _finding(problem, found, settings)


def _finding(problem: Problem, found: Sequence[_Coarse], settings: CheckSettings) -> Finding:
    worst, timestep = max(found, key=lambda one: one.share), problem.simulation.working.timestep_s
    message = (
        f"with a timestep of {timestep:g} s the servos' angles are off by {worst.share:.1%} of their travel "
        f"against {timestep / _FINER:g} s: take {min(one.timestep_s for one in found):g} s"
    )
    return Finding(TIMESTEP_CONVERGENCE.name, worst.gait, worst.share, settings.motion_change, message)


def _enough(
    problem: Problem, coarse: Simulator, gait: Gait, finer: Trajectory, settings: CheckSettings
) -> float:
    """Return the longest timestep at which motion no longer depends on it, s, or the shortest tried."""
    timestep = coarse.fidelity.timestep_s
    if _FINEST * coarse.duration(gait) / timestep > settings.step_budget:
        return timestep / _FINER
    finest = _at(coarse, _FINEST).run(gait)
    if _apart(problem, finer, finest) > settings.motion_change:
        return timestep / _FINEST
    halved = _at(coarse, 2).run(gait)
    return timestep / (2 if _apart(problem, halved, finest) <= settings.motion_change else _FINER)


def _at(coarse: Simulator, divisor: int) -> Simulator:
    fidelity = coarse.fidelity
    return coarse.at(Fidelity(timestep_s=fidelity.timestep_s / divisor, integrator=fidelity.integrator))


def _apart(problem: Problem, run: Trajectory, other: Trajectory) -> float:
    """Return the RMS difference of the servos' angles over the RMS of their motion; inf where one fails."""
    if run.status != "ok" or other.status != "ok":
        return float("inf")
    names = [f"position.{name}" for name in problem.channel_names]
    off = [np.mean((run[name] - np.interp(run.time, other.time, other[name])) ** 2) for name in names]
    moved = float(np.mean([np.var(other[name]) for name in names]))
    return float(np.sqrt(np.mean(off) / moved)) if moved else 0.0
