"""Scenarios: one draw each of friction, servo strength, servo zeros and start pose."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from gaitopt.core.streams import seeded
from gaitopt.effects.active import EffectValues, RobotEffects
from gaitopt.effects.added import with_added
from gaitopt.problem.instruments import scalar_joints
from gaitopt.problem.problem import Problem
from gaitopt.problem.tolerances import WIDEST


@dataclass(frozen=True)
class Scenario:
    """One draw of the quantities that are not known exactly.

    Attributes:
        friction: factor on every friction coefficient.
        servo_strength: factor on every torque limit; the supply voltage does the same to a servo.
        servo_trim: zero error of each servo, rad; none where it is empty.
        start_pose_rad: standard deviation of the errors of the joints' start angles and of the heading.
        pose_seed: seed of those errors.
        framed: commands are sampled at the servo's frame rate and act one frame late.
        effects: what this scenario's robot has beside the problem's effects; see `Problem.with_robots`. A
            simulator of several scenarios has one robot, so it refuses them; see `setup.prepared`.
    """

    friction: float = 1.0
    servo_strength: float = 1.0
    servo_trim: tuple[float, ...] = ()
    start_pose_rad: float = 0.0
    pose_seed: int = 0
    framed: bool = False
    effects: EffectValues = ()


NOMINAL = Scenario()
"""The nominal robot."""


def draw_scenarios(problem: Problem, count: int, seed: Iterable[int]) -> tuple[Scenario, ...]:
    """Return `count` scenarios; the same seed gives the same ones.

    The last gets its commands at the servo's frames, if the problem says so (`Scenarios.framed`).
    """
    tolerances, framed_last = problem.file.tolerances, problem.file.scenarios.framed
    rng = seeded(*seed)
    scenarios = []
    for index in range(count):
        of_all = np.array((tolerances.friction, tolerances.servo_strength))
        friction, strength = 1.0 + WIDEST * of_all * rng.uniform(-1.0, 1.0, 2)
        widest_trim = WIDEST * math.radians(tolerances.servo_trim_deg)
        trim = widest_trim * rng.uniform(-1.0, 1.0, len(problem.channel_names))
        pose_seed = int(rng.integers(2**31))
        framed = framed_last and index == count - 1
        scenarios.append(
            Scenario(
                friction=float(friction),
                servo_strength=float(strength),
                servo_trim=tuple(trim.tolist()),
                start_pose_rad=tolerances.start_pose_rad,
                pose_seed=pose_seed,
                framed=framed,
            )
        )
    return tuple(scenarios)


def scenario_model(
    model: mujoco.MjModel, problem: Problem, scenario: Scenario, effects: RobotEffects
) -> mujoco.MjModel:
    """Return a copy of a compiled model with a scenario's friction and strength, and with effects."""
    model = copy.copy(model)
    named = [model.geom(name).id for name in problem.roles.pads + problem.roles.body]
    touching = named or list(range(model.ngeom))
    model.geom_friction[touching] *= scenario.friction
    pairs = np.isin(model.pair_geom1, touching) | np.isin(model.pair_geom2, touching)
    model.pair_friction[pairs] *= scenario.friction
    model.actuator_forcerange[:] *= scenario.servo_strength
    effects.edit(model)
    return model


def disturb_start(batch: Batch, problem: Problem, scenario: Scenario) -> None:
    """Add a scenario's start-pose errors to the hinge joints, and turn a free first body about up."""
    model = batch.model
    qpos = batch.bind("qpos")[0]
    rng = seeded(scenario.pose_seed)
    hinges = [j for j in scalar_joints(model) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)]
    errors = np.zeros(model.nq)
    errors[model.jnt_qposadr[hinges]] = scenario.start_pose_rad * rng.standard_normal(len(hinges))
    qpos += with_added(errors, model)
    if model.njnt and int(model.jnt_type[0]) == int(mujoco.mjtJoint.mjJNT_FREE):
        turn, turned = np.empty(4), np.empty(4)
        angle = scenario.start_pose_rad * rng.standard_normal()
        mujoco.mju_axisAngle2Quat(turn, np.array(problem.roles.up), angle)
        mujoco.mju_mulQuat(turned, turn, qpos[3:7].copy())
        qpos[3:7] = turned
