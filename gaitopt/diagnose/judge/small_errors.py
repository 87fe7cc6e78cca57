"""Perturbed robots: they differ from a robot by small unknown errors that no effect describes."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import numpy as np

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.judge.settings import SMALL_ERRORS, SmallErrorSettings
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario


def perturbed_robots(
    simulator: Simulator,
    seed: int,
    count: int,
    stream: int = Stream.SMALL_ERRORS,
    settings: SmallErrorSettings = SMALL_ERRORS,
) -> list[Simulator]:
    """Return robots with other start poses, masses, hinges and numerics.

    Args:
        simulator: the robot without errors.
        seed: seed of the draws.
        count: number of robots; every second one has half the timestep, every third the other friction cone.
        stream: stream of their randomness.
        settings: sizes of the errors.
    """
    rng = generator(seed, stream)
    size = simulator.problem.file.tolerances.start_pose_rad
    seeds = rng.integers(2**31, size=count).tolist()
    scenarios = tuple(Scenario(start_pose_rad=size, pose_seed=number) for number in seeds)
    base = Simulator.build(simulator.problem, scenarios, simulator.fidelity)
    halved = simulator.fidelity.model_copy(update={"timestep_s": 0.5 * simulator.fidelity.timestep_s})
    robots = []
    for index in range(count):
        model = with_small_errors(base.models[index], simulator, rng, settings)
        if index % 3 == 1:
            swap_cone(model)
        robot = replace(base, scenarios=(scenarios[index],), models=(model,))
        robots.append(robot.at(halved if index % 2 else simulator.fidelity))
    return robots


def with_small_errors(
    model: mujoco.MjModel,
    simulator: Simulator,
    rng: np.random.Generator,
    settings: SmallErrorSettings = SMALL_ERRORS,
) -> mujoco.MjModel:
    """Return a robot with a small error in the mass of each body and the stiffness of each hinge."""
    model = copy.copy(model)
    factors = 1.0 + settings.mass * rng.standard_normal(model.nbody)
    model.body_mass[:] *= factors
    model.body_inertia[:] *= factors[:, None]
    hinges = [model.joint(name).id for name in simulator.problem.roles.hinges]
    errors = settings.hinge * rng.standard_normal(len(hinges))
    model.jnt_stiffness[hinges] *= 1.0 + errors - (errors.mean() if len(hinges) else 0.0)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def swap_cone(model: mujoco.MjModel) -> None:
    """Give a model the other friction cone, as stiff against creep as possible."""
    elliptic = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
    if int(model.opt.cone) == elliptic:
        model.opt.impratio = 4.0 * model.opt.impratio
    else:
        model.opt.cone = elliptic
        model.opt.impratio = 10.0
