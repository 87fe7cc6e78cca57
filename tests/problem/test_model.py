"""The compiled model: parameters, full precision, fidelity."""

import copy
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import STRIDER, same_bits

from gaitopt.problem.model import build_model, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.rollout import Simulator

BOTH = ["arcfold", STRIDER]


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
    """Writing is idempotent: the run folder contains the model that was simulated."""
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


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_fidelity_is_the_models(strider: Problem, integrator: str) -> None:
    fidelity = Fidelity.model_validate({"timestep_s": 5e-4, "integrator": integrator})
    model = build_model(strider, fidelity)
    assert model.opt.timestep == 5e-4
    assert model.opt.integrator == getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")


@pytest.mark.parametrize("name", ["arcfold", "quadruped", "arcfold-held"])
def test_islands_are_looked_for_where_there_is_more_than_one_tree(name: str) -> None:
    """In one tree this changes no bit."""
    problem = load_problem(name)
    simulator = Simulator.build(problem)
    flag = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    (model,) = simulator.models
    assert bool(model.opt.disableflags & flag) == (model.ntree == 1)
    other = copy.copy(model)
    other.opt.disableflags ^= flag
    twin = simulator.with_model(other)
    gait = next(iter(problem.baselines.values()))
    walks = [one.run(gait, duration=1.0) for one in (simulator, twin)]
    assert same_bits(*walks) == (model.ntree == 1)
