"""Which named parameters change nothing: to the last bit, or nothing on the ground?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor

import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError
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
    """Change each parameter both ways, and find those that change nothing in the fastest baseline."""
    gait = min(problem.baselines.values(), key=lambda g: g.period_s, default=None)
    if gait is None:
        return
    changed = {name: _changed(problem, name, settings) for name in problem.file.parameters}
    seconds = max(settings.parameter_s, gait.period_s)
    first = executor.submit(_rollout, problem, gait, seconds)
    futures = {
        name: [executor.submit(_rollout, one, gait, seconds) for one in both]
        for name, both in changed.items()
    }
    nominal, model = first.result(), build_model(problem)
    if nominal is None or nominal.status != "ok":
        return
    for name, both in changed.items():
        reason = _inert_friction(model, both)
        if reason or all(_same(nominal, future.result()) for future in futures[name]):
            what = reason or "nothing, to the last bit"
            message = (
                f"changing {name} by a factor of {settings.parameter_change:g} either way changes {what}"
            )
            yield Finding(INERT_PARAMETER.name, gait.name, 0.0, 0.0, message, parameter=name)


def _changed(problem: Problem, name: str, settings: CheckSettings) -> list[Problem]:
    """Return the problem with a parameter changed both ways."""
    value, factor = problem.file.parameters[name].value, settings.parameter_change
    small = settings.parameter_at_zero
    values = [value * factor, value / factor] if value else [small, -small]
    return [problem.with_parameters({name: changed}) for changed in values]


def _same(nominal: Trajectory, other: Trajectory | None) -> bool:
    """Return whether a rollout is the same to the last bit. A value that MuJoCo refuses acts."""
    return other is not None and all(
        np.array_equal(nominal[s], other[s], equal_nan=True) for s in nominal.signals
    )


def _rollout(problem: Problem, gait: Gait, seconds: float) -> Trajectory | None:
    """Return a rollout; None where there is no such robot: its value is out of MuJoCo's bounds."""
    try:
        return Simulator.build(problem).run(gait, duration=seconds)
    except GaitoptError:
        return None


def _inert_friction(model: mujoco.MjModel, changed: Sequence[Problem]) -> str:
    """Return why a changed friction coefficient does nothing on the ground, or an empty string."""
    try:
        others = [build_model(one) for one in changed]
    except GaitoptError:
        return ""
    unlike = [(model.geom_friction != other.geom_friction).any(axis=1) for other in others]
    around = surroundings(model)
    geoms = [geom for geom in np.flatnonzero(np.any(unlike, axis=0)).tolist() if geom not in around]
    pairs = [(geom, ground) for geom in geoms for ground in around if can_touch(model, geom, ground)]
    mixed = [mixed_friction(model, *pair) for pair in pairs]
    if not pairs or any(
        (mixed_friction(other, *pair) != before).any()
        for other in others
        for pair, before in zip(pairs, mixed, strict=True)
    ):
        return ""
    geom = model.geom(pairs[0][1])
    return (
        "no friction on the ground: of two geoms of equal priority MuJoCo takes the larger coefficient, "
        f"and {geom.name or 'the ground'} has {geom.friction[0]:g}; give the robot's geoms a higher priority"
    )
