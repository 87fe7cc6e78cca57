"""The robots obey physics."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import STRIDER, still

from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

BOTH = ["arcfold", STRIDER]


@pytest.fixture(scope="module")
def model(arcfold: Problem) -> mujoco.MjModel:
    return build_model(arcfold)


def speed(problem: Problem, gait: str) -> float:
    """Forward speed of a baseline on the nominal robot."""
    simulator = Simulator.build(problem)
    trajectory = simulator.run(problem.baselines[gait])
    assert trajectory.status == "ok"
    robot = Robot.of(simulator.models[0])
    return measure(problem, problem.baselines[gait], trajectory, robot)["speed_m_s"]


def test_without_friction_nobody_goes_anywhere(arcfold: Problem, strider: Problem) -> None:
    for problem, gait, parameters in (
        (arcfold, "square-1s", ("mu_tape", "mu_base")),
        (strider, "square", ("mu_rear", "mu_front", "mu_trunk")),
    ):
        smooth = problem.with_parameters(dict.fromkeys(parameters, 0.0))
        assert abs(speed(smooth, gait)) < 0.05 * abs(speed(problem, gait)), problem.name


def test_friction_matters(arcfold: Problem) -> None:
    nominal = speed(arcfold, "square-1s")
    for name in ("mu_tape", "mu_base"):
        value = arcfold.file.parameters[name].value
        assert speed(arcfold.with_parameters({name: 0.8 * value}), "square-1s") != nominal


def test_a_motionless_gait_goes_nowhere(arcfold: Problem, strider: Problem) -> None:
    for problem in (arcfold, strider):
        trajectory = Simulator.build(problem).run(still(problem), duration=2.0)
        assert np.ptp(trajectory.stacked("marker"), axis=0).max() < 1e-5


@pytest.mark.parametrize("robot", BOTH)
def test_energy_does_not_appear_from_nowhere(robot: Path | str) -> None:
    """A passive robot, bent and dropped, never has more mechanical energy than it began with.

    The total rises only by the energy that a compressed contact or the closed loop gives back.
    """
    model = build_model(load_problem(robot), Fidelity(timestep_s=2e-4, integrator="implicitfast"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    height = next(i for i in range(model.njnt) if model.joint(i).name in ("base", "above"))
    data.qpos[model.jnt_qposadr[height] + (2 if model.jnt_type[height] == 0 else 0)] += 0.02
    energies = []
    for _ in range(1500):
        mujoco.mj_step(model, data)
        energies.append(data.energy.sum())
    energy = np.array(energies)
    fallen = Robot.of(model).weight * 0.02
    assert energy.max() <= energy[0] + 1e-4 * fallen
    assert energy[0] - energy[-1] == pytest.approx(fallen, rel=0.2)
    # In flight, before it lands after 64 ms, only the hinges' damping takes energy, and very little.
    assert energy[250] == pytest.approx(energy[0], abs=1e-2 * fallen)


def test_gait_and_weight_set_the_pace_not_the_timestep(arcfold: Problem) -> None:
    """The mean speed over perturbed starts barely changes when the timestep is halved."""
    working = arcfold.simulation.working
    halved = Fidelity(timestep_s=working.timestep_s / 2.0, integrator=working.integrator)
    starts = tuple(Scenario(start_pose_rad=5e-3, pose_seed=i) for i in range(4))
    coarse = Simulator.build(arcfold, starts, working)
    robot, gait = Robot.of(coarse.models[0]), arcfold.baselines["square-1s"]
    speeds = []
    for simulator in (coarse, coarse.at(halved)):
        runs = [simulator.run(gait, i) for i in range(len(starts))]
        speeds.append(np.mean([measure(arcfold, gait, run, robot)["speed_m_s"] for run in runs]))
    assert abs(speeds[0] - speeds[1]) < max(0.1 * abs(speeds[1]), 1e-3)
