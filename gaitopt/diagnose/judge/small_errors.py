"""Robots that differ from the nominal one in what nobody knows exactly and no hypothesis owns."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import numpy as np

from gaitopt.core.streams import Stream, generator
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

DRAWS = 7
"""Robots drawn."""

MASS_ERROR = 0.02
"""Relative standard deviation of each body's mass: a kitchen scale on parts of some grams."""

HINGE_ERROR = 0.05
"""Relative standard deviation of one hinge's stiffness about the others'."""


def perturbed_robots(
    simulator: Simulator, seed: int, count: int = DRAWS, stream: int = Stream.SMALL_ERRORS
) -> list[Simulator]:
    """Return robots with other start poses, masses, hinges and numerics.

    Args:
        simulator: the nominal robot.
        seed: seed of the draws.
        count: how many; every second one has half the timestep, every third the other friction cone.
        stream: stream of their randomness.
    """
    rng = generator(seed, stream)
    size = simulator.problem.file.scenarios.start_pose_rad
    seeds = rng.integers(2**31, size=count).tolist()
    scenarios = tuple(Scenario(start_pose_rad=size, pose_seed=number) for number in seeds)
    base = Simulator.build(simulator.problem, scenarios, simulator.fidelity)
    halved = simulator.fidelity.model_copy(update={"timestep_s": 0.5 * simulator.fidelity.timestep_s})
    robots = []
    for index in range(count):
        model = with_small_errors(base.models[index], simulator, rng)
        if index % 3 == 1:
            swap_cone(model)
        robot = replace(base, scenarios=(scenarios[index],), models=(model,))
        robots.append(robot.at(halved if index % 2 else simulator.fidelity))
    return robots


def with_small_errors(
    model: mujoco.MjModel, simulator: Simulator, rng: np.random.Generator
) -> mujoco.MjModel:
    """Return a robot whose masses and hinges are a little wrong, each on its own."""
    model = copy.copy(model)
    factors = 1.0 + MASS_ERROR * rng.standard_normal(model.nbody)
    model.body_mass[:] *= factors
    model.body_inertia[:] *= factors[:, None]
    hinges = [model.joint(name).id for name in simulator.problem.roles.hinges]
    errors = HINGE_ERROR * rng.standard_normal(len(hinges))
    model.jnt_stiffness[hinges] *= 1.0 + errors - (errors.mean() if len(hinges) else 0.0)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def swap_cone(model: mujoco.MjModel) -> None:
    """Give a model the friction cone that it has not, as stiff against creep as can be."""
    elliptic = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
    if int(model.opt.cone) == elliptic:
        model.opt.impratio = 4.0 * model.opt.impratio
    else:
        model.opt.cone = elliptic
        model.opt.impratio = 10.0
