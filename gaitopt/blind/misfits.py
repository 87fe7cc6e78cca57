"""Trials that do not fit the others of their case: a wrong file, a slip, a servo that lost its supply."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gaitopt.blind.factory import CaseFactory, observed
from gaitopt.effects.library.friction import scale_friction
from gaitopt.effects.parts import Parts
from gaitopt.gait.gait import Gait
from gaitopt.gait.logged import LoggedCommands
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

_ROW_S = 0.02
"""Time between two rows of commands that end early, s."""


@dataclass(frozen=True)
class Misfit:
    """What was wrong with one trial.

    Attributes:
        name: ``wrong_file``, ``slip`` or ``supply_lost``.
        figures: what was drawn for it.
    """

    name: str
    figures: Mapping[str, float]


def draw_misfit(factory: CaseFactory, gait: str, rng: np.random.Generator) -> Misfit:
    """Draw what is wrong with a trial of a gait."""
    walked = factory.walked_s(factory.gaits[gait])
    others = [index for index, name in enumerate(factory.gaits) if name != gait]
    kinds = ["slip", "supply_lost", *(["wrong_file"] if others else [])]
    name = str(rng.choice(kinds))
    drawn = {
        "wrong_file": {"gait": float(rng.choice(others)) if others else 0.0},
        "slip": {"friction": float(rng.uniform(0.15, 0.4))},
        "supply_lost": {"at_s": float(rng.uniform(0.3, 0.6) * walked)},
    }
    return Misfit(name, drawn[name])


def walk_with(misfit: Misfit, factory: CaseFactory, robot: Simulator, gait: Gait) -> Trajectory:
    """Return what a camera sees of a trial of a gait with which something is wrong.

    Args:
        misfit: what is wrong.
        factory: what all cases share.
        robot: the case's robot.
        gait: the gait that the trial names.
    """
    duration = factory.walked_s(gait)
    if misfit.name == "wrong_file":
        other = list(factory.gaits.values())[int(misfit.figures["gait"])]
        return observed(robot, other, max(duration, factory.walked_s(other)))
    if misfit.name == "slip":
        return observed(_slippery(robot, misfit.figures["friction"]), gait, duration)
    time = np.arange(0.0, duration, _ROW_S)
    targets = np.where((time < misfit.figures["at_s"])[:, None], gait.targets(time), np.nan)
    log = LoggedCommands.of(robot.problem.channel_names, time, targets)
    return robot.observe(robot.run(log, 0, duration))


def _slippery(robot: Simulator, factor: float) -> Simulator:
    """Return a robot on a floor that was dusty in one trial."""
    model = copy.copy(robot.models[0])
    parts = Parts(model, robot.problem.roles, robot.problem.channel_names)
    scale_friction(model, parts.touching, factor)
    return robot.with_model(model)
