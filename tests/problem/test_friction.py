"""Friction acts, whatever the priorities in the MJCF, and the nominal contact stays as MuJoCo has it."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
import pytest

from gaitopt.effects import EFFECTS
from gaitopt.problem.model import build_model, nominal_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.check import check
from gaitopt.simulation.rollout import Simulator

MJCF = """
<mujoco><option gravity="4 0 -9.81"/><worldbody>
  <geom name="floor" type="plane" size="50 50 1" {floor}/>{more}
  <body name="sled" pos="0 0 0.05"><freejoint/>
    <geom name="sole" type="box" size="0.1 0.1 0.05" {sole}/><site name="marker"/>
    <body><joint name="wag" axis="0 0 1" damping="0.1"/>
      <geom name="tail" size="0.01" mass="0.01" contype="0"/></body>
  </body>
</worldbody><actuator><position name="wag" joint="wag"/></actuator></mujoco>
"""
PROBLEM = """
name = "sled"
model = "robot.xml"
{friction}
roles = {{ marker = "marker", pads = ["sole"] }}
start = {{ settle = false }}
channels = {{ wag = {{ range_deg = [-10, 10] }} }}
baselines.still.period_s = 0.5
baselines.still.channels.wag = {{ duty = 0.5, phase = 0.0, amplitude_deg = 0.0 }}
simulation.working = {{ timestep_s = 1e-3, integrator = "implicitfast" }}
simulation.reference = {{ timestep_s = 1e-3, integrator = "implicitfast" }}
parameters.mu = {{ value = {mu}, unit = "1", origin = "assumed", sets = ["{path}/@friction"] }}
"""
KEY = '<keyframe><key name="start" qpos="0 0 0.05 1 0 0 0 0"/></keyframe></mujoco>'


def sled(
    folder: Path,
    floor: str = "",
    sole: str = "",
    mu: float = 0.6,
    path: str = ".//geom[@name='sole']",
    friction: str = "",
    more: str = "",
) -> Problem:
    text = MJCF.format(floor=floor, sole=sole, more=more).replace("</mujoco>", KEY)
    (folder / "robot.xml").write_text(text)
    (folder / "problem.toml").write_text(PROBLEM.format(mu=mu, path=path, friction=friction))
    return load_problem(folder)


def travel(problem: Problem) -> float:
    simulator = Simulator.build(problem)
    walk = simulator.run(problem.baselines["still"], duration=0.5)
    return float(walk["marker.x"][-1] - walk["marker.x"][0])


def contact(model: mujoco.MjModel) -> list[float]:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    first = data.contact[0]
    return [float(first.dim), *first.friction, *first.solref, *first.solimp]


@pytest.mark.parametrize("floor", ["", 'priority="2"', 'friction="0.2"'])
def test_a_named_coefficient_acts_whatever_the_floors(tmp_path: Path, floor: str) -> None:
    problem = sled(tmp_path, floor)
    slid = [travel(problem.with_parameters({"mu": mu})) for mu in (0.1, 0.2, 0.3)]
    assert slid[0] > slid[1] > slid[2] > 1e-3
    expected = [0.5 * (4.0 - 9.81 * mu) * 0.25 for mu in (0.1, 0.2, 0.3)]
    assert slid == pytest.approx(expected, rel=0.05)


def test_effects_and_tolerances_act_where_priorities_are_equal(tmp_path: Path) -> None:
    problem = sled(tmp_path, mu=0.3)
    slippery = problem.with_effects({"pad_friction": {"scale": 0.5}})
    assert travel(slippery) > 2.0 * travel(problem)
    model = Simulator.build(slippery).models[0]
    assert contact(model)[1] == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("floor", "sole"),
    [
        ("", ""),
        ('friction="0.9 0.01 0.001" condim="4"', 'friction="0.4 0.02 0.0001"'),
        ('priority="3" friction="0.3" solref="0.01 1"', ""),
        ('solmix="2" solref="0.03 0.8" solimp="0.8 0.9 0.002 0.5 2"', 'condim="6"'),
    ],
)
def test_without_a_named_coefficient_the_contact_is_mujocos(tmp_path: Path, floor: str, sole: str) -> None:
    nowhere = ".//geom[@name='tail']"
    ours = build_model(sled(tmp_path, floor, sole, path=nowhere))
    theirs = build_model(sled(tmp_path, floor, sole, path=nowhere, friction='friction = "mujoco"'))
    assert contact(ours) == pytest.approx(contact(theirs), rel=1e-14)
    assert ours.geom("sole").priority[0] > ours.geom("floor").priority[0]


def test_a_named_coefficient_of_the_floor_acts_too(tmp_path: Path) -> None:
    problem = sled(tmp_path, path=".//geom[@name='floor']")
    assert travel(problem.with_parameters({"mu": 0.1})) > travel(problem.with_parameters({"mu": 0.3})) > 1e-3


def test_where_it_cannot_act_it_says_so_in_one_line(tmp_path: Path) -> None:
    problem = sled(tmp_path, friction='friction = "mujoco"')
    parts = nominal_parts(problem)
    reasons = {EFFECTS[name].why_not(parts) for name in ("pad_friction", "grip_variation", "friction_load")}
    assert reasons == {"floor has no lower priority than sole: its friction counts, or the larger one"}
    step = '<geom name="step" type="box" size="1 1 1" pos="9 0 0" friction="0.2"/>'
    nowhere = ".//geom[@name='tail']"
    mixed = nominal_parts(sled(tmp_path, sole='friction="0.1"', path=nowhere, more=step))
    assert "priority" in str(EFFECTS["pad_friction"].why_not(mixed))


def test_a_robot_with_priority_is_left_as_it_is(arcfold: Problem) -> None:
    model = build_model(arcfold)
    assert set(np.unique(model.geom_priority).tolist()) == {0, 1}


@pytest.mark.slow
def test_check_tries_both_directions(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as pool:
        acting = check(sled(tmp_path, mu=0.3), pool)
        inert = check(sled(tmp_path, mu=0.3, friction='friction = "mujoco"'), pool)
    assert "inert_parameter" not in {finding.name for finding in acting}
    (finding,) = [finding for finding in inert if finding.name == "inert_parameter"]
    assert "factor of 2 either way" in finding.message
