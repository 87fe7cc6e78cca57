"""Which named parameters change nothing: to the last bit, or nothing on the ground?"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor

import mujoco
import numpy as np

from gaitopt.gait.gait import Gait
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.robot.contact import can_touch, mixed_friction
from gaitopt.robot.trajectory import Trajectory
from gaitopt.robot.tree import surroundings
from gaitopt.simulation.audit.finding import INERT_PARAMETER, Finding
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.rollout import Simulator


def check_parameters(problem: Problem, executor: Executor, settings: CheckSettings) -> Iterator[Finding]:
    """Change each parameter, and find those that change nothing in the fastest baseline."""
    gait = min(problem.baselines.values(), key=lambda g: g.period_s, default=None)
    if gait is None:
        return
    names = list(problem.file.parameters)
    problems = [problem, *(_changed(problem, name, settings) for name in names)]
    seconds = max(settings.parameter_s, gait.period_s)
    futures = [executor.submit(_rollout, changed, gait, seconds) for changed in problems]
    nominal, *others = [future.result() for future in futures]
    model = build_model(problem)
    for name, changed, trajectory in zip(names, problems[1:], others, strict=True):
        reason = _inert_friction(model, build_model(changed))
        same = nominal.status == "ok" and all(
            np.array_equal(nominal[s], trajectory[s], equal_nan=True) for s in nominal.signals
        )
        if reason or same:
            what = reason or "nothing, to the last bit"
            share = 100.0 * (settings.parameter_change - 1.0)
            message = f"changing {name} by {share:.0f} % changes {what}"
            yield Finding(INERT_PARAMETER.name, gait.name, 0.0, 0.0, message, parameter=name)


def _changed(problem: Problem, name: str, settings: CheckSettings) -> Problem:
    value = problem.file.parameters[name].value
    return problem.with_parameters(
        {name: value * settings.parameter_change if value else settings.parameter_at_zero}
    )


def _rollout(problem: Problem, gait: Gait, seconds: float) -> Trajectory:
    return Simulator.build(problem).run(gait, duration=seconds)


def _inert_friction(model: mujoco.MjModel, changed: mujoco.MjModel) -> str:
    """Return why a changed friction coefficient does nothing on the ground, or an empty string."""
    geoms = np.flatnonzero((model.geom_friction != changed.geom_friction).any(axis=1))
    pairs = [(g, w) for g in geoms.tolist() for w in surroundings(model) if can_touch(model, g, w)]
    acts = [(mixed_friction(model, *pair) != mixed_friction(changed, *pair)).any() for pair in pairs]
    if not pairs or any(acts):
        return ""
    geom = model.geom(pairs[0][1])
    return (
        "no friction on the ground: of two geoms of equal priority MuJoCo takes the larger coefficient, "
        f"and {geom.name or 'the ground'} has {geom.friction[0]:g}; give the robot's geoms a higher priority"
    )
