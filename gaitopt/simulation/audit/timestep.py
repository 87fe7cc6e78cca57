"""Does the mean speed over perturbed starts change when the timestep is halved?"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import Executor

import numpy as np

from gaitopt.core.statistics import NORMAL_95
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.audit.finding import DIVERGED, TIMESTEP_CONVERGENCE, Finding
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario


def check_timestep(
    problem: Problem, executor: Executor, settings: CheckSettings, diverged: Collection[str]
) -> Iterator[Finding]:
    """Play each baseline from perturbed starts at the working timestep and at half of it.

    Gaits that are known to have diverged are left out, and all of them on a robot without a marker.
    """
    if problem.roles.marker is None:
        return
    working = problem.simulation.working
    spread = settings.start_spread_rad
    starts = tuple(Scenario(start_pose_rad=spread, pose_seed=i) for i in range(settings.starts))
    coarse = Simulator.build(problem, starts, working)
    simulators = (coarse, coarse.at(working.scaled(0.5)))
    for gait in problem.baselines.values():
        if gait.name in diverged:
            continue
        steps = 3.0 * coarse.duration(gait) / working.timestep_s
        count = int(np.clip(settings.step_budget // steps, 2, settings.starts))
        runs = [list(executor.map(each.run, [gait] * count, range(count))) for each in simulators]
        if any(run.status != "ok" for some in runs for run in some):
            yield _failed(gait, runs, working.timestep_s)
        else:
            yield from _changed(coarse, gait, runs, settings)


def _failed(gait: Gait, runs: Sequence[Sequence[Trajectory]], timestep_s: float) -> Finding:
    failed = [[run.status for run in some if run.status != "ok"] for some in runs]
    message = (
        f"from perturbed starts, {len(failed[0])} of {len(runs[0])} simulations fail at "
        f"{timestep_s:g} s and {len(failed[1])} at half of it: "
        f"{', '.join(sorted({*failed[0], *failed[1]}))}"
    )
    return Finding(DIVERGED.name, gait.name, math.inf, 0.0, message)


def _changed(
    coarse: Simulator, gait: Gait, runs: Sequence[Sequence[Trajectory]], settings: CheckSettings
) -> Iterator[Finding]:
    """Compare mean speeds; differences below their standard error, one-sided at 95 %, do not count."""
    problem, robot, count = coarse.problem, Robot.of(coarse.models[0]), len(runs[0])
    speeds = [[measure(problem, gait, run, robot)[SPEED.name] for run in some] for some in runs]
    before, after = np.mean(speeds, axis=1).tolist()
    error = float(np.sqrt(np.var(speeds, axis=1, ddof=1).sum() / count))
    limit = max(settings.timestep_change * abs(after), settings.timestep_floor_m_s)
    if not abs(after - before) <= limit + NORMAL_95 * error:
        message = (
            f"halving the timestep of {coarse.fidelity.timestep_s:g} s changes the mean speed over {count} "
            f"starts from {1e3 * before:.3g} to {1e3 * after:.3g} mm/s "
            f"(standard error {1e3 * error:.2g} mm/s)"
        )
        yield Finding(TIMESTEP_CONVERGENCE.name, gait.name, abs(after - before), limit, message)
