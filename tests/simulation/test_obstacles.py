"""A robot among obstacles: figures are the robot's own, not those of the first body in the file."""

from pathlib import Path

import pytest

from gaitopt.effects import EFFECTS
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

MJCF = """
<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 0.1"/>
  {before}
  <body name="trunk" pos="0 0 0.2" euler="0 90 0"><freejoint/>
    <geom name="trunk" type="box" size="0.02 0.05 0.1" mass="1"/><site name="marker"/>
    <body><joint name="hip" axis="0 1 0" damping="1e-3"/><geom name="leg" size="0.01" mass="0.01"/></body>
    <body><joint name="wag" axis="0 0 1" damping="1e-3"/><geom name="tail" size="0.01" mass="0.01"/></body>
  </body>
</worldbody>
<tendon><fixed name="cable"><joint joint="wag" coef="0.5"/></fixed></tendon>
<actuator>
  <position name="hip" joint="hip" forcerange="-1 1"/>
  <position name="wag" tendon="cable" forcerange="-1 1"/>
</actuator></mujoco>
"""
OBSTACLES = """
  <body name="ramp" pos="0 0 0.02"><geom type="box" size="0.5 0.5 0.02"/></body>
  <body name="box" pos="0 2 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="50"/></body>
"""
PROBLEM = """
name = "walker"
model = "robot.xml"
roles = { marker = "marker", pads = ["trunk"] }
channels = { hip = { range_deg = [-10, 10] }, wag = { range_deg = [-10, 10] } }
[baselines.swing]
period_s = 0.5
[baselines.swing.channels]
hip = { duty = 0.5, phase = 0.0, amplitude_deg = 5.0 }
wag = { duty = 0.5, phase = 0.0, amplitude_deg = 5.0 }
[simulation]
working = { timestep_s = 1e-3, integrator = "implicitfast" }
reference = { timestep_s = 1e-3, integrator = "implicitfast" }
"""


@pytest.fixture(params=["", OBSTACLES], ids=["alone", "among obstacles"])
def problem(request: pytest.FixtureRequest, tmp_path: Path) -> Problem:
    (tmp_path / "robot.xml").write_text(MJCF.format(before=request.param))
    (tmp_path / "problem.toml").write_text(PROBLEM)
    return load_problem(tmp_path)


def test_a_robot_drawn_on_its_side_stands_level_and_is_never_in_the_air(problem: Problem) -> None:
    simulator = Simulator.build(problem)
    robot, gait = Robot.of(simulator.models[0]), problem.baselines["swing"]
    metrics = measure(problem, gait, simulator.run(gait), robot)
    assert metrics["tilt_rad"] < 0.01
    assert metrics["airtime"] == 0.0
    assert robot.weight == pytest.approx(1.02 * 9.81)


def test_effects_act_on_the_trunk(problem: Problem) -> None:
    parts = nominal_parts(problem)
    assert parts.model.body(parts.trunk).name == "trunk"
    assert parts.mass == pytest.approx(1.02)
    laden = Simulator.build(problem.with_effects({"payload_mass": {"mass_kg": 0.5}})).models[0]
    assert laden.body("trunk").mass[0] == pytest.approx(1.5)


def test_a_larger_robot_stands_among_the_same_obstacles(problem: Problem) -> None:
    before, grown = (
        Simulator.build(one).models[0]
        for one in (problem, problem.with_effects({"geometry_scale": {"scale": 1.1}}))
    )
    for name in filter(None, (before.body(i).name for i in range(1, before.nbody))):
        sizes = [model.geom_rbound[model.body(name).geomadr[0]] for model in (before, grown)]
        assert sizes[1] / sizes[0] == pytest.approx(1.0 if name in ("ramp", "box") else 1.1)


def test_a_tendon_switches_off_no_effect_of_the_other_servos(problem: Problem) -> None:
    parts = nominal_parts(problem)
    idle = {name for name, effect in EFFECTS.items() if name.startswith("servo_") and effect.why_not(parts)}
    assert idle == {"servo_back_emf"}  # for the damping of the joints
    model = Simulator.build(problem.with_effects({"servo_friction": {"torque_n_m": 0.1}})).models[0]
    friction = {name: model.dof_frictionloss[model.joint(name).dofadr[0]] for name in ("hip", "wag")}
    assert friction == {"hip": 0.1, "wag": 0.0}
