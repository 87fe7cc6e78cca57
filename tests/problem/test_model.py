"""The compiled robot: what the contract says of it, and what physics says."""

import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import STRIDER, same_bits, still

from gaitopt.problem.model import build_model, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.problem.start import start_targets
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Scenario, Simulator

BOTH = ["arcfold", STRIDER]


@pytest.fixture(scope="module")
def model(arcfold: Problem) -> mujoco.MjModel:
    return build_model(arcfold)


def names(model: mujoco.MjModel, kind: str, count: int) -> list[str]:
    """Names of all elements of one kind."""
    return [getattr(model, kind)(i).name for i in range(count)]


def speed(problem: Problem, gait: str) -> float:
    """Forward speed of a baseline on the nominal robot."""
    simulator = Simulator.build(problem)
    trajectory = simulator.run(problem.baselines[gait])
    assert trajectory.status == "ok"
    robot = Robot.of(simulator.models[0])
    return measure(problem, problem.baselines[gait], trajectory, robot)["speed_m_s"]


# --- what the contract says of arcfold --------------------------------------------------------


def test_actuators_are_the_seeds_in_its_order(model: mujoco.MjModel) -> None:
    assert names(model, "actuator", model.nu) == ["mid_act", "foot1", "foot2"]
    assert [model.joint(i).name for i in model.actuator_trnid[:, 0]] == ["mid_left", "foot1", "foot2"]


def test_joints_keep_the_seeds_names(model: mujoco.MjModel) -> None:
    chains = {f"{part}_{side}" for part in ("first", "mid", "last") for side in ("left", "right")}
    hinges = [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    assert {model.joint(i).name for i in hinges} == chains | {"foot1", "foot2"}


def test_the_first_body_is_the_module_that_carries_foot1(model: mujoco.MjModel) -> None:
    assert model.body_parentid[model.body("foot1").id] == 1
    assert model.body_parentid[1] == 0


def test_ctrl_is_a_target_angle(model: mujoco.MjModel) -> None:
    """Position servos on joints, gear 1; a torque limit is the force range."""
    for i in range(model.nu):
        assert model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        assert model.actuator_gear[i].tolist() == [1, 0, 0, 0, 0, 0]
        gain = model.actuator_gainprm[i, 0]
        assert gain > 0.0
        assert model.actuator_biasprm[i, :2].tolist() == [0.0, -gain]
        assert not model.actuator_ctrllimited[i]
        assert model.actuator_forcelimited[i]
        low, high = model.actuator_forcerange[i]
        assert low == -high < 0.0


def test_friction_is_by_priority_and_not_by_pairs(model: mujoco.MjModel) -> None:
    assert model.npair == 0
    ground = model.geom("ground")
    touching = [i for i in range(model.ngeom) if model.geom_contype[i] and model.geom_bodyid[i] != 0]
    assert touching
    for i in touching:
        assert model.geom_priority[i] > ground.priority[0]


def test_pads_are_the_geoms_of_the_feet(arcfold: Problem, model: mujoco.MjModel) -> None:
    feet = {model.body("foot1").id, model.body("foot2").id}
    on_feet = [model.geom(i).name for i in range(model.ngeom) if model.geom_bodyid[i] in feet]
    assert sorted(arcfold.roles.pads) == sorted(on_feet)
    mu = arcfold.file.parameters["mu_tape"].value
    assert {model.geom(pad).friction[0] for pad in on_feet} == {mu}


def test_every_geom_that_may_touch_the_ground_has_a_role(arcfold: Problem, model: mujoco.MjModel) -> None:
    touching = {
        model.geom(i).name
        for i in range(model.ngeom)
        if model.geom_bodyid[i] != 0 and model.geom_contype[i] & model.geom("ground").conaffinity[0]
    }
    assert set(arcfold.roles.pads) | set(arcfold.roles.body) == touching


def test_the_marker_is_the_end_effector(arcfold: Problem, model: mujoco.MjModel) -> None:
    assert arcfold.roles.marker == "end_effector"
    assert model.site("end_effector").bodyid[0] > 0


def test_every_parameter_says_where_it_comes_from(arcfold: Problem) -> None:
    seeds = {"k_joint", "b_joint", "k_motor", "b_motor", "mu_tape", "mu_base", "mass"}
    assert seeds <= set(arcfold.file.parameters)
    for name, parameter in arcfold.file.parameters.items():
        assert re.match(r"(measured|datasheet|assumed)\b", parameter.origin), name
        assert parameter.unit, name


def test_every_gram_has_an_origin(arcfold: Problem, model: mujoco.MjModel) -> None:
    """The mass is the sum of the named masses, each as often as it is used, and nothing besides."""
    total = model.body_mass.sum()
    masses = {n: p.value for n, p in arcfold.file.parameters.items() if p.unit == "kg"}
    budget = 0.0
    for name, value in masses.items():
        heavier = build_model(arcfold.with_parameters({name: value + 1e-3})).body_mass.sum()
        count = (heavier - total) / 1e-3
        assert count == pytest.approx(round(count), abs=1e-6)
        assert round(count) >= 1, name
        budget += round(count) * value
    assert budget == pytest.approx(total, rel=1e-9)


# --- what the contract says of any robot ------------------------------------------------------


@pytest.mark.parametrize("robot", BOTH)
def test_it_rests_at_its_start(robot: Path | str) -> None:
    problem = load_problem(robot)
    model = build_model(problem)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    np.testing.assert_array_equal(data.ctrl, start_targets(problem))
    mujoco.mj_forward(model, data)
    marker = data.site(problem.roles.marker)
    before = marker.xpos.copy()
    chunk = 10
    for _ in range(round(5.0 / (chunk * model.opt.timestep))):
        mujoco.mj_step(model, data, chunk)
        assert np.linalg.norm(marker.xpos - before) / (chunk * model.opt.timestep) < 1e-4
        assert np.abs(data.qvel[-model.nu :]).max() < 1e-3
        assert np.abs(data.qvel).max() < 1e-3
        before = marker.xpos.copy()


@pytest.mark.parametrize("robot", BOTH)
def test_the_start_stands_on_the_ground(robot: Path | str) -> None:
    problem = load_problem(robot)
    model = build_model(problem)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    force, load = np.zeros(6), 0.0
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, force)
        load += force[0]
    assert load == pytest.approx(Robot.of(model).weight, rel=1e-3)


@pytest.mark.parametrize("robot", ["arcfold", "arcfold-published", STRIDER])
def test_the_weight_is_the_whole_robots(robot: Path | str) -> None:
    model = build_model(load_problem(robot))
    assert Robot.of(model).weight == pytest.approx(model.body_mass.sum() * 9.81, rel=1e-12)


@pytest.mark.parametrize("robot", BOTH)
def test_numbers_keep_full_precision(robot: Path | str) -> None:
    problem = load_problem(robot)
    odd = {name: p.value * (1.0 + math.pi * 1e-12) for name, p in problem.file.parameters.items()}
    changed = problem.with_parameters(odd)
    text = nominal_mjcf(changed)
    numbers = {number for element in ET.fromstring(text).iter() for value in element.attrib.values()
               for number in value.split()}  # fmt: skip
    for value in odd.values():
        assert repr(value) in numbers
    start = ET.fromstring(text).find("keyframe/key[@name='start']")
    assert start is not None
    model = mujoco.MjModel.from_xml_string(text)
    assert [float(q) for q in start.get("qpos", "").split()] == model.key("start").qpos.tolist()
    assert model.key("start").qpos.tolist() == build_model(changed).key("start").qpos.tolist()


@pytest.mark.parametrize("robot", ["arcfold", "arcfold-published", STRIDER])
def test_the_written_model_is_a_problem_of_the_same_bits(tmp_path: Path, robot: Path | str) -> None:
    """Writing is idempotent: what a run folder holds is what was run."""
    problem = load_problem(robot)
    text = nominal_mjcf(problem)
    (tmp_path / "model.xml").write_text(text)
    (tmp_path / "problem.toml").write_text(problem.to_toml("model.xml"))
    written = load_problem(tmp_path)
    assert nominal_mjcf(written) == text
    gait = next(iter(problem.baselines.values()))
    one, other = (Simulator.build(p).run(gait, duration=0.2) for p in (problem, written))
    assert same_bits(one, other)


def test_a_changed_robot_is_written_with_its_changes(tmp_path: Path, strider: Problem) -> None:
    changed = strider.with_parameters({"mu_rear": 0.7, "mass": 0.05})
    (tmp_path / "model.xml").write_text(nominal_mjcf(changed))
    (tmp_path / "problem.toml").write_text(changed.to_toml("model.xml"))
    model = build_model(load_problem(tmp_path))
    assert model.geom("rear_foot").friction[0] == 0.7
    assert model.body("trunk").mass[0] == 0.05


def test_the_model_stands_alone(arcfold: Problem) -> None:
    root = ET.fromstring(nominal_mjcf(arcfold))
    assert not [element.tag for element in root.iter() if element.tag == "include" or element.get("file")]
    option = root.find("option")
    assert option is not None
    assert float(option.get("timestep", "nan")) == arcfold.simulation.working.timestep_s
    assert option.get("integrator") == arcfold.simulation.working.integrator


@pytest.mark.parametrize("robot", BOTH)
def test_every_parameter_reaches_the_compiled_model(robot: Path | str) -> None:
    problem = load_problem(robot)
    nominal = nominal_mjcf(problem)
    one = build_model(problem)
    for name, parameter in problem.file.parameters.items():
        changed = problem.with_parameters({name: parameter.value * 1.25})
        assert nominal_mjcf(changed) != nominal, name
        other = build_model(changed)
        fields = ("body_mass", "geom_friction", "jnt_stiffness", "dof_damping", "dof_armature")
        fields += ("actuator_gainprm", "actuator_forcerange")
        assert any(not np.array_equal(getattr(one, f), getattr(other, f)) for f in fields), name


def test_a_servos_no_load_speed_is_its_torque_over_its_damping(strider: Problem) -> None:
    robot = Robot.of(build_model(strider.with_parameters({"torque_limit": 0.5, "b_servo": 0.1})))
    assert robot.torque_limit.tolist() == [0.5, 0.5]
    assert robot.no_load_speed == pytest.approx([5.0, 5.0])
    undamped = Robot.of(build_model(strider.with_parameters({"b_servo": 0.0})))
    assert undamped.no_load_speed.tolist() == [math.inf, math.inf]


def test_a_servo_turns_at_its_no_load_speed(strider: Problem) -> None:
    """Held in the air with nothing on the leg, the motor's torque is used up by its own speed."""
    model = build_model(strider.with_parameters({"torque_limit": 0.02, "b_servo": 0.01, "k_servo": 50.0}))
    model.opt.gravity[:] = 0.0
    model.geom_contype[:] = 0
    data = mujoco.MjData(model)
    data.ctrl[:] = 100.0
    mujoco.mj_step(model, data, 500)
    assert data.actuator_velocity == pytest.approx(Robot.of(model).no_load_speed, rel=1e-3)


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_fidelity_is_the_models(strider: Problem, integrator: str) -> None:
    fidelity = Fidelity.model_validate({"timestep_s": 5e-4, "integrator": integrator})
    model = build_model(strider, fidelity)
    assert model.opt.timestep == 5e-4
    assert model.opt.integrator == getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")


# --- limiting cases ---------------------------------------------------------------------------


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

    The total rises by what a compressed contact or the closed loop gives back, no further.
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
    # In flight, before it lands after 64 ms, next to nothing is lost: only the hinges' damping.
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
