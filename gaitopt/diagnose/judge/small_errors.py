"""Perturbed robots: they differ from a robot by small unknown errors that no effect describes."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.judge.settings import SMALL_ERRORS, SmallErrorSettings
from gaitopt.effects.active import ActiveEffect
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.tolerances import SmallErrors, draw_errors, draw_measurement, own_bodies


def perturbed_robots(
    simulator: Simulator,
    seed: int,
    count: int,
    stream: int = Stream.SMALL_ERRORS,
    settings: SmallErrorSettings = SMALL_ERRORS,
) -> list[Simulator]:
    """Return robots with other start poses, masses, hinges, places of tags, and numerics.

    Args:
        simulator: the robot without errors.
        seed: seed of the draws.
        count: number of robots; every second one has half the timestep, every third the other friction cone.
        stream: stream of their randomness.
        settings: sizes of the errors.
    """
    rng = generator(seed, stream)
    size = simulator.problem.file.tolerances.start_pose_rad
    posed = _posed(simulator, size, rng, count)
    halved = simulator.fidelity.scaled(0.5)
    robots = []
    for index, robot in enumerate(posed):
        model = with_small_errors(robot.models[0], simulator, rng, settings)
        misplace_tags(model, simulator.problem, generator(seed, Stream.TAG_MOUNTING, stream, index))
        if index % 3 == 1:
            swap_cone(model)
        erring = robot.with_model(model)
        robots.append(erring.at(halved if is_finer(index) else simulator.fidelity))
    return robots


def almost_equal_robots(simulator: Simulator, seed: int, count: int, share: float) -> list[Simulator]:
    """Return robots that differ from one another by much less than any robot can be known.

    Args:
        simulator: the robot.
        seed: seed of the draws.
        count: number of robots; every second one has half the timestep.
        share: how far their start poses differ, in tolerances.
    """
    size = share * simulator.problem.file.tolerances.start_pose_rad
    robots = _posed(simulator, size, generator(seed, Stream.ALMOST_EQUAL_ROBOTS), count)
    halved = simulator.fidelity.scaled(0.5)
    return [robot.at(halved) if is_finer(index) else robot for index, robot in enumerate(robots)]


def _posed(simulator: Simulator, size: float, rng: np.random.Generator, count: int) -> list[Simulator]:
    """Return the robot with start poses that are wrong by so much, rad, each in a scenario of its own."""
    seeds = rng.integers(2**31, size=count).tolist()
    scenarios = [Scenario(start_pose_rad=size, pose_seed=number) for number in seeds]
    return Simulator.build(simulator.problem, scenarios, simulator.fidelity).split()


def is_finer(index: int) -> bool:
    """Whether one of the robots that are made exactly has half the timestep."""
    return index % 2 == 1


def is_finer_tolerant(index: int) -> bool:
    """Whether one of the robots that are a little wrong in everything has half the timestep."""
    return index % 4 == 1


def perturbed_scenarios(
    simulator: Simulator, seed: int, count: int, settings: SmallErrorSettings = SMALL_ERRORS
) -> list[Scenario]:
    """Return robots with other masses, hinges and start poses as scenarios, those of the posterior's draws.

    Args:
        simulator: the robot without errors.
        seed: seed of the draws.
        count: number of robots.
        settings: sizes of the errors.
    """
    rng, size = generator(seed, Stream.POSTERIOR_DRAWS), simulator.problem.file.tolerances.start_pose_rad
    parts, scenarios = simulator.effects.nominal, []
    for number in rng.integers(2**31, size=count).tolist():
        mass, hinges = _factors(len(own_bodies(parts.model)), len(parts.hinges), rng, settings)
        errors = SmallErrors(mass=tuple(mass.tolist()), hinge_stiffness=tuple(hinges.tolist()))
        scenarios.append(Scenario(errors, size, number))
    return scenarios


def tolerant_robots(simulator: Simulator, seed: int, count: int) -> list[Simulator]:
    """Return robots that are a little wrong in everything, by the problem's tolerances, and their cameras.

    Args:
        simulator: the robot without errors.
        seed: seed of the draws.
        count: number of robots; every fourth one has half the timestep, every third the other friction cone.
    """
    problem, halved = simulator.problem, simulator.fidelity.scaled(0.5)
    drawn = [*_tolerances_drawn(simulator, seed, count)]
    erring = Simulator.build(problem, [scenario for scenario, _ in drawn], simulator.fidelity).split()
    robots = []
    for index, (robot, (_, measurement)) in enumerate(zip(erring, drawn, strict=True)):
        measured = (*robot.effects.active, *measurement)
        model = copy.copy(robot.models[0])
        misplace_tags(model, problem, generator(seed, Stream.TAG_MOUNTING, Stream.TOLERANT_ROBOTS, index))
        if index % 3 == 1:
            swap_cone(model)
        robot = replace(robot.with_model(model), effects=replace(robot.effects, active=measured))
        robots.append(robot.at(halved) if is_finer_tolerant(index) else robot)
    return robots


def tolerant_scenarios(simulator: Simulator, seed: int, count: int) -> list[Scenario]:
    """Return the scenarios of `tolerant_robots`: their errors and start poses, no cameras and numerics."""
    return [scenario for scenario, _ in _tolerances_drawn(simulator, seed, count)]


def _tolerances_drawn(
    simulator: Simulator, seed: int, count: int
) -> Iterator[tuple[Scenario, tuple[ActiveEffect, ...]]]:
    """Yield the errors of robots and of their cameras, by the problem's tolerances."""
    tolerances, rng = simulator.problem.file.tolerances, generator(seed, Stream.TOLERANT_ROBOTS)
    for _ in range(count):
        errors = draw_errors(simulator.effects.nominal, tolerances, rng)
        pose_seed = int(rng.integers(2**31))
        measurement = draw_measurement(tolerances, rng)
        yield Scenario(errors, tolerances.start_pose_rad, pose_seed), measurement


def with_small_errors(
    model: mujoco.MjModel,
    simulator: Simulator,
    rng: np.random.Generator,
    settings: SmallErrorSettings = SMALL_ERRORS,
) -> mujoco.MjModel:
    """Return a robot with a small error in the mass of each body and the stiffness of each hinge."""
    model = copy.copy(model)
    hinges = [model.joint(name).id for name in simulator.problem.roles.hinges]
    mass, stiffness = _factors(model.nbody, len(hinges), rng, settings)
    model.body_mass[:] *= mass
    model.body_inertia[:] *= mass[:, None]
    model.jnt_stiffness[hinges] *= stiffness
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _factors(
    bodies: int, hinges: int, rng: np.random.Generator, settings: SmallErrorSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a factor on the mass of each body, and one on the stiffness of each hinge about the others'."""
    mass = 1.0 + settings.mass * rng.standard_normal(bodies)
    errors = settings.hinge * rng.standard_normal(hinges)
    return mass, 1.0 + errors - (errors.mean() if hinges else 0.0)


def misplace_tags(model: mujoco.MjModel, problem: Problem, rng: np.random.Generator) -> None:
    """Give each tag whose signals are observed another place and turn on its body, by the tolerances.

    A marker on that body is measured by its tag, so it moves along.

    Args:
        model: the robot, which changes.
        problem: its problem, which says where tags sit.
        rng: the randomness.
    """
    tolerances, marker = problem.file.tolerances, problem.roles.marker
    for name in sorted({tag.site for tag in problem.file.tags.values() if tag.site in problem.observed}):
        site = model.site(name).id
        shift = 1e-3 * tolerances.tag_place_mm * rng.standard_normal(3)
        turn = Rotation.from_rotvec(np.deg2rad(tolerances.tag_turn_deg) * rng.standard_normal(3))
        before = Rotation.from_quat(model.site_quat[site], scalar_first=True)
        place = model.site_pos[site].copy()
        model.site_quat[site] = (before * turn).as_quat(scalar_first=True)
        model.site_pos[site] += before.apply(shift)
        if (
            marker is not None
            and model.body_weldid[model.site(marker).bodyid[0]] == model.body_weldid[model.site_bodyid[site]]
        ):
            _move_along(model, site, model.site(marker).id, before, place)


def _move_along(
    model: mujoco.MjModel, site: int, marker: int, before: Rotation, place: NDArray[np.float64]
) -> None:
    """Move a marker as a site on the same body moved that was turned so, and at a place, before."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body, own = model.site_bodyid[site], model.site_bodyid[marker]
    frame, origin = Rotation.from_matrix(data.xmat[body].reshape(3, 3)), data.xpos[body]
    inside = before.inv().apply(frame.inv().apply(data.site_xpos[marker] - origin) - place)
    after = Rotation.from_matrix(data.site_xmat[site].reshape(3, 3)).apply(inside) + data.site_xpos[site]
    model.site_pos[marker] = data.xmat[own].reshape(3, 3).T @ (after - data.xpos[own])


def swap_cone(model: mujoco.MjModel) -> None:
    """Give a model the other friction cone, as stiff against creep as possible."""
    elliptic = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
    if int(model.opt.cone) == elliptic:
        model.opt.impratio = 4.0 * model.opt.impratio
    else:
        model.opt.cone = elliptic
        model.opt.impratio = 10.0
