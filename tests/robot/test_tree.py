"""The robot is the tree that its actuators move, wherever it stands in the file."""

import mujoco
import numpy as np
import pytest

from gaitopt.robot.tree import driven_joints, free_joint, has_obstacles, robot_bodies, servo_joint, trunk

LEGS = """
  <body name="torso" pos="0 0 0.1">
    <freejoint/><geom size="0.03"/>
    <body name="left"><joint name="a" axis="0 1 0"/><geom size="0.01" pos="0 0.05 -0.05"/>
      <body name="shin" pos="0 0.05 -0.05"><joint name="b" axis="0 1 0"/><geom size="0.01"/></body>
    </body>
  </body>
"""
RAMP = '<body name="ramp" pos="1 0 0"><geom type="box" size="0.2 0.2 0.01" euler="0 10 0"/></body>'
BOX = '<body name="box" pos="0 1 1"><freejoint/><geom type="box" size="1 1 1"/></body>'
SERVOS = """
  <position name="one" joint="a"/>
  <position name="both" tendon="both"/>
  <position name="alone" tendon="alone"/>
"""
TENDONS = """
  <fixed name="both"><joint joint="a" coef="0.5"/><joint joint="b" coef="-0.5"/></fixed>
  <fixed name="alone"><joint joint="b" coef="2"/></fixed>
"""


def model(world: str, servos: str = SERVOS, more: str = "") -> mujoco.MjModel:
    floor = '<geom name="floor" type="plane" size="1 1 0.1"/>'
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{floor}{world}</worldbody><tendon>{TENDONS}</tendon>"
        f"<actuator>{servos}</actuator>{more}</mujoco>"
    )


@pytest.mark.parametrize("world", [LEGS, RAMP + BOX + LEGS, BOX + LEGS + RAMP])
def test_ramps_and_loose_boxes_are_not_the_robot(world: str) -> None:
    robot = model(world)
    assert robot.body(trunk(robot)).name == "torso"
    names = {robot.body(i).name for i in np.flatnonzero(robot_bodies(robot))}
    assert names == {"torso", "left", "shin"}
    assert has_obstacles(robot) == ("ramp" in world)
    assert free_joint(robot, trunk(robot)) == robot.body("torso").jntadr[0]


def test_a_fixed_base_is_the_trunk() -> None:
    robot = model(RAMP + LEGS.replace("<freejoint/>", ""))
    assert robot.body(trunk(robot)).name == "torso"
    assert free_joint(robot, trunk(robot)) is None


def test_trees_that_are_tied_to_the_robot_belong_to_it() -> None:
    tied = '<equality><connect body1="box" body2="shin" anchor="0 0 0"/></equality>'
    robot = model(LEGS + BOX, more=tied)
    assert robot_bodies(robot)[1:].all()
    assert not has_obstacles(robot)


def test_a_tendon_is_not_read_as_a_joint() -> None:
    robot = model(LEGS)
    a, b = robot.joint("a").id, robot.joint("b").id
    assert [driven_joints(robot, i) for i in range(3)] == [{a: 1.0}, {a: 0.5, b: -0.5}, {b: 2.0}]
    assert [servo_joint(robot, i) for i in range(3)] == [a, -1, b]
