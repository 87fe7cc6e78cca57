"""Scenarios: robots with small errors, each with a start pose of its own."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from gaitopt.core.streams import seeded
from gaitopt.effects.active import EffectValues, RobotEffects
from gaitopt.effects.added import with_added
from gaitopt.effects.parts import Parts
from gaitopt.problem.instruments import scalar_joints
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.robot.tree import free_joint
from gaitopt.simulation.tolerances import NO_ERRORS, SmallErrors, apply_errors, draw_errors


@dataclass(frozen=True)
class Scenario:
    """One robot among those that the problem's tolerances allow, and how its walk begins.

    Attributes:
        errors: what is wrong with the robot and its floor.
        start_pose_rad: standard deviation of the errors of the joints' start angles and of the heading.
        pose_seed: seed of those errors.
        framed: commands are sampled at the servo's frame rate and act one frame late.
        effects: what this scenario's robot has beside the problem's effects; see `Problem.with_robots`. A
            simulator of several scenarios has one robot, so it refuses them; see `setup.prepared`.
    """

    errors: SmallErrors = NO_ERRORS
    start_pose_rad: float = 0.0
    pose_seed: int = 0
    framed: bool = False
    effects: EffectValues = ()


NOMINAL = Scenario()
"""The nominal robot."""


def draw_scenarios(problem: Problem, count: int, seed: Iterable[int]) -> tuple[Scenario, ...]:
    """Return `count` scenarios; the same seed gives the same ones.

    The last gets its commands at the servo's frames, if the problem says so (`Scenarios.framed`).

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    tolerances, rng = problem.file.tolerances, seeded(*seed)
    parts = nominal_parts(problem)
    return tuple(
        Scenario(
            errors=draw_errors(parts, tolerances, rng),
            start_pose_rad=tolerances.start_pose_rad,
            pose_seed=int(rng.integers(2**31)),
            framed=problem.file.scenarios.framed and index == count - 1,
        )
        for index in range(count)
    )


def scenario_model(
    model: mujoco.MjModel, problem: Problem, scenario: Scenario, effects: RobotEffects
) -> mujoco.MjModel:
    """Return a copy of a compiled model with a scenario's small errors, and with effects."""
    model = copy.copy(model)
    apply_errors(Parts(model, problem.roles, problem.channel_names), scenario.errors)
    effects.edit(model)
    return model


def disturb_start(batch: Batch, problem: Problem, scenario: Scenario) -> None:
    """Add a scenario's start-pose errors to the hinge joints, and turn a free trunk about up."""
    model = batch.model
    qpos = batch.bind("qpos")[0]
    rng = seeded(scenario.pose_seed)
    hinges = [j for j in scalar_joints(model) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)]
    errors = np.zeros(model.nq)
    errors[model.jnt_qposadr[hinges]] = scenario.start_pose_rad * rng.standard_normal(len(hinges))
    qpos += with_added(errors, model)
    joint = free_joint(model, Parts(model, problem.roles, problem.channel_names).trunk)
    if joint is not None:
        place = int(model.jnt_qposadr[joint]) + 3
        turn, turned = np.empty(4), np.empty(4)
        angle = scenario.start_pose_rad * rng.standard_normal()
        mujoco.mju_axisAngle2Quat(turn, np.array(problem.roles.up), angle)
        mujoco.mju_mulQuat(turned, turn, qpos[place : place + 4].copy())
        qpos[place : place + 4] = turned
