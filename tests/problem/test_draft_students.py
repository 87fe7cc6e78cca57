"""Files as students write them: what is wrong is said at once, and the rest is asked of MuJoCo."""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.problem.draft import Draft, make_problem
from gaitopt.problem.drafting.heading import forward_axis, up_axis
from gaitopt.problem.drafting.names import name_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

FLOOR = '<geom type="plane" size="5 5 0.1"/>'
RAMP = '<body pos="0.6 0 0"><geom type="box" size="0.1 0.3 0.01" euler="0 -10 0"/></body>'
BOX = '<body name="box" pos="-0.5 0 0.1"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>'

LEG = """
<body pos="{x} {y} 0">
  <joint name="hip_{n}" axis="0 1 0" range="-40 40" damping="0.02" armature="1e-4"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.05" size="0.006" mass="0.01"/>
  <body pos="0 0 -0.05">
    <joint name="knee_{n}" axis="0 1 0" range="-60 60" damping="0.02" armature="1e-4"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.05" size="0.006" mass="0.01"/>
    <geom type="sphere" pos="0 0 -0.055" size="0.008" mass="0.002"/>
  </body>
</body>
"""
CORNERS = {"a": (0.06, 0.04), "b": (0.06, -0.04), "c": (-0.06, 0.04), "d": (-0.06, -0.04)}
LEGS = "".join(LEG.format(n=n, x=x, y=y) for n, (x, y) in CORNERS.items())
DOG = f'<body pos="0 0 0.12"><freejoint/><geom type="box" size="0.08 0.03 0.015" mass="0.1"/>{LEGS}</body>'
SERVOS = "".join(
    f'<position joint="{kind}_{n}" kp="4" forcerange="-0.3 0.3"/>'
    for n in CORNERS
    for kind in ("hip", "knee")
)


def mjcf(world: str, servos: str, more: str = "") -> str:
    return f"<mujoco>{more}<worldbody>{world}</worldbody><actuator>{servos}</actuator></mujoco>"


def drafted(folder: Path, text: str, **options: bool | str) -> tuple[Draft, Problem]:
    path = folder / "robot.xml"
    path.write_text(text)
    draft = make_problem("mine", path, folder / "mine", **options)
    return draft, load_problem(folder / "mine")


def speeds(problem: Problem) -> dict[str, float]:
    simulator = Simulator.build(problem)
    robot = Robot.of(simulator.models[0])
    return {
        name: measure(problem, gait, simulator.run(gait), robot)["speed_m_s"]
        for name, gait in problem.baselines.items()
    }


def test_a_dog_without_names_behind_a_ramp_trots(tmp_path: Path) -> None:
    draft, problem = drafted(tmp_path, mjcf(FLOOR + RAMP + BOX + DOG, SERVOS))
    assert draft.family == "quadruped"
    assert list(problem.baselines) == ["trot", "walk", "bound"]
    assert "airtime" not in problem.objective.constraints
    roles = problem.roles
    assert roles.forward == (1.0, 0.0, 0.0)
    assert len(roles.pads) == 4
    simulator = Simulator.build(problem)
    model = simulator.models[0]
    assert {int(model.geom(pad).type[0]) for pad in roles.pads} == {2}  # spheres: the feet
    assert model.body(roles.trunk).jntnum[0] == 1
    assert model.site(roles.marker).bodyid[0] == model.body(roles.trunk).id
    assert problem.channel_names == [f"{kind}_{n}" for n in CORNERS for kind in ("hip", "knee")]
    assert speeds(problem)["trot"] > 0.01


def test_a_dog_that_lies_along_y_goes_along_y(tmp_path: Path) -> None:
    turned = DOG.replace('<body pos="0 0 0.12">', '<body name="dog" pos="0 0 0.12" euler="0 0 90">')
    _, problem = drafted(tmp_path, mjcf(FLOOR + turned, SERVOS))
    assert problem.roles.forward == (0.0, 1.0, 0.0)
    assert speeds(problem)["trot"] > 0.01


def test_a_keyframe_is_the_stance_whichever_it_is(tmp_path: Path) -> None:
    pose = "0 0 0.12 1 0 0 0" + " 0.3 -0.6" * 4
    keys = f'<keyframe><key name="flat"/><key name="home" qpos="{pose}"/></keyframe>'
    draft, problem = drafted(tmp_path, mjcf(FLOOR + DOG, SERVOS, keys))
    assert "home" in draft.stance
    held = problem.file.start.ctrl_deg
    assert held["hip_a"] == pytest.approx(17.189, abs=1e-3)
    assert held["knee_d"] == pytest.approx(-34.377, abs=1e-3)


def test_motors_become_servos_that_hold_the_robot(tmp_path: Path) -> None:
    motors = SERVOS.replace("position", "motor").replace(
        'kp="4" forcerange="-0.3 0.3"', 'gear="0.3" ctrlrange="-1 1"'
    )
    with pytest.raises(GaitoptError, match="--from-motors"):
        drafted(tmp_path, mjcf(FLOOR + DOG, motors))
    draft, problem = drafted(tmp_path, mjcf(FLOOR + DOG, motors), from_motors=True)
    assert any("assumed" in change for change in draft.changes)
    assert problem.file.parameters["torque_limit"].value == pytest.approx(0.3)
    assert len(problem.roles.pads) == 4
    assert max(speeds(problem).values()) > 2e-3


LINK = """
<body name="link{n}" pos="-0.06 0 0">
<joint name="bend{n}" axis="0 0 1" range="-60 60" damping="1e-3" armature="1e-5"/>
<geom type="capsule" fromto="0 0 0 -0.05 0 0" size="0.01" mass="0.02"/>{rest}</body>
"""


def snake(links: int) -> str:
    rest = ""
    for n in reversed(range(links)):
        rest = LINK.format(n=n, rest=rest)
    head = '<geom name="head" type="capsule" fromto="0 0 0 -0.05 0 0" size="0.01" mass="0.02"/>'
    return f'<body name="first" pos="0 0 0.011"><freejoint/>{head}{rest}</body>'


def bends(links: int) -> str:
    return "".join(f'<position joint="bend{n}" kp="1" forcerange="-0.2 0.2"/>' for n in range(links))


def test_a_snake_undulates_and_a_swimmer_swims(tmp_path: Path) -> None:
    draft, problem = drafted(tmp_path, mjcf(FLOOR + snake(5), bends(5)))
    assert draft.family == "snake"
    assert len(problem.roles.pads) == 6
    assert "tilt_rad" not in problem.objective.constraints
    (tmp_path / "wet").mkdir()
    water = '<option density="1000" viscosity="1e-3" gravity="0 0 0"/>'
    draft, problem = drafted(tmp_path / "wet", mjcf(snake(5), bends(5), water))
    assert draft.family == "swimmer"
    assert problem.roles.pads == []
    assert "airtime" not in problem.objective.constraints
    assert speeds(problem)["undulation"] > 0.005
    (tmp_path / "asked").mkdir()
    draft, _ = drafted(tmp_path / "asked", mjcf(FLOOR + snake(5), bends(5)), family="crawler")
    assert [gait.name for gait in draft.gaits] == ["first-guess"]


def test_a_shin_beside_its_foot_is_no_pad_and_odd_ranges_are_ranges(tmp_path: Path) -> None:
    low = FLOOR + DOG.replace('pos="0 0 -0.055" size="0.008"', 'pos="0 0 -0.05" size="0.0065"')
    radian = '<compiler angle="radian"/>'
    odd = low.replace("-40 40", "-0.7 1.0").replace("-60 60", "-1.234567 0.7654321")
    draft, problem = drafted(tmp_path, mjcf(odd, SERVOS, radian))
    assert draft.family == "quadruped"
    assert len(problem.roles.pads) >= 4
    assert problem.file.channels["hip_a"].range_deg == (-40.107, 57.296)


def test_a_robot_that_falls_over_is_no_snake(tmp_path: Path) -> None:
    foot = '<body pos="0 0 -0.1"><joint name="ankle" axis="0 1 0" damping="0.01"/><geom size="0.01"/></body>'
    shin = foot.replace("ankle", "knee").replace("</body>", f"{foot}</body>")
    pole = f'<body name="pole" pos="0 0 0.22"><freejoint/><geom size="0.03" pos="0.01 0 0"/>{shin}</body>'
    servos = '<position joint="knee" kp="5"/><position joint="ankle" kp="5"/>'
    draft, _ = drafted(tmp_path, mjcf(FLOOR + pole, servos))
    assert draft.family == "other"
    assert any("falls over" in remark and "ctrl_deg" in remark for remark in draft.warnings)


def test_all_mistakes_are_told_at_once_each_with_its_remedy(tmp_path: Path) -> None:
    servos = '<motor joint="hip_a" gear="1" ctrlrange="-1 1"/><position joint="hip_b" ctrlrange="-30 30"/>'
    with pytest.raises(GaitoptError) as error:
        drafted(tmp_path, mjcf(DOG, servos))
    text = str(error.value)
    assert "3 problems" in text
    for part in ("--from-motors", "write it in rad", '<geom name="floor" type="plane"'):
        assert part in text
    assert "\n" not in text


def test_a_joint_that_makes_the_simulation_diverge_is_named(tmp_path: Path) -> None:
    bare = DOG.replace(' damping="0.02" armature="1e-4"', "")
    stiff = SERVOS.replace('kp="4" forcerange="-0.3 0.3"', 'kp="500"')
    with pytest.raises(GaitoptError, match="add armature and damping to hip_a"):
        drafted(tmp_path, mjcf(FLOOR + bare, stiff))


def test_a_spatial_tendon_is_refused_and_a_fixed_one_is_a_channel(tmp_path: Path) -> None:
    joints = '<joint joint="hip_a" coef="0.5"/><joint joint="hip_b" coef="0.5"/>'
    tendon = f'<tendon><fixed name="pair">{joints}</fixed></tendon>'
    servos = SERVOS.replace('joint="hip_a"', 'tendon="pair"', 1)
    draft, problem = drafted(tmp_path, mjcf(FLOOR + DOG, servos, tendon))
    assert problem.channel_names[0] == "pair"
    assert problem.roles.hinges == []
    assert "tendon over hip_a, hip_b" in draft.channels[0].origin
    (tmp_path / "spatial").mkdir()
    sites = FLOOR + '<site name="hook"/>' + DOG.replace("<freejoint/>", '<freejoint/><site name="eye"/>')
    spatial = '<tendon><spatial name="rope"><site site="hook"/><site site="eye"/></spatial></tendon>'
    with pytest.raises(GaitoptError, match="rope: pulls at no hinge or slide"):
        drafted(tmp_path / "spatial", mjcf(sites, SERVOS + '<position tendon="rope"/>', spatial))


def test_the_command_says_what_it_rests_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.xml").write_text(mjcf(FLOOR + DOG, SERVOS))
    out = tmp_path / "mine"
    assert cli.main(["new", "mine", "--mjcf", str(tmp_path / "robot.xml"), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    for part in ("family: quadruped, as it has 4 limbs", "forward:", "pads: what touches", "names for"):
        assert part in printed


def test_a_robot_on_a_rail_goes_along_it_however_its_trunk_is_turned() -> None:
    trunk = """
    <body pos="0 0 0.1" euler="0 90 0"><joint name="lift" type="slide" axis="1 0 0"/>
      <joint name="rail" type="slide" axis="0 0 1"/><geom type="box" size="0.02 0.03 0.05" mass="0.1"/>
      <body pos="0 0 0.05"><joint name="arm" axis="0 1 0"/><geom type="box" size="0.01 0.01 0.03"/></body>
    </body>"""
    model = mujoco.MjModel.from_xml_string(mjcf(FLOOR + trunk, '<position joint="arm" kp="1"/>'))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    axis, why = forward_axis(model, data, [], up_axis(model)[0])
    np.testing.assert_allclose(axis, [1.0, 0.0, 0.0], atol=1e-6)
    assert "the one way that the joint 'rail' leaves it" in why


def test_an_actuator_gets_no_name_that_another_section_has() -> None:
    sections = (
        '<actuator><position joint="hip"/></actuator><actuator><position name="hip" joint="knee"/></actuator>'
    )
    root = ET.fromstring(f"<mujoco><worldbody/>{sections}</mujoco>")
    assert name_parts(root) == ["1 actuator"]
    assert [element.get("name") for element in root.iter("position")] == ["hip_2", "hip"]


def test_a_snake_on_idle_wheels_is_a_snake(tmp_path: Path) -> None:
    wheel = (
        '<body pos="-0.025 {y} 0"><joint axis="0 1 0"/><geom type="ellipsoid" size="0.02 0.004 0.02"/></body>'
    )
    axle = wheel.format(y=0.02) + wheel.format(y=-0.02)
    world = FLOOR + snake(4).replace("<joint", f"{axle}<joint").replace("<freejoint/>", f"<freejoint/>{axle}")
    draft, problem = drafted(tmp_path, mjcf(world.replace("0.011", "0.02"), bends(4)))
    assert draft.family == "snake"
    assert len(problem.roles.pads) == 10
    assert len(problem.roles.hinges) == 10
    assert speeds(problem)["undulation"] > 0.05


def test_servos_and_feet_that_differ_have_their_own_numbers(tmp_path: Path) -> None:
    world = FLOOR + DOG.replace('size="0.008" mass="0.002"', 'size="0.008" mass="0.002" friction="1.3"', 2)
    _, problem = drafted(tmp_path, mjcf(world, SERVOS.replace('"-0.3 0.3"', '"-0.5 0.5"', 1)))
    limits = {n: p.value for n, p in problem.file.parameters.items() if n.startswith("torque_limit")}
    assert limits == {"torque_limit_hip_a": 0.5, "torque_limit_knee_a": 0.3}
    assert sorted(p.value for n, p in problem.file.parameters.items() if n.startswith("mu_pads")) == [
        1.0,
        1.3,
    ]
    assert problem.file.parameters["k_servo"].value == 4.0
    weaker = Robot.of(Simulator.build(problem.with_parameters({"torque_limit_knee_a": 0.1})).models[0])
    assert weaker.torque_limit.tolist() == pytest.approx([0.5] + [0.1] * 7)


def test_servos_are_asked_for_no_more_than_they_can(tmp_path: Path) -> None:
    slow = DOG.replace('damping="0.02"', 'damping="0.15"')  # 2 rad/s without load
    _, problem = drafted(tmp_path, mjcf(FLOOR + slow, SERVOS))
    assert problem.objective.constraints["command_speed_ratio"].max == 1.0
    no_load = Robot.of(Simulator.build(problem).models[0]).no_load_speed
    assert no_load == pytest.approx(2.0)
    peaks = [gait.peak_command_speed().max() / 2.0 for gait in problem.baselines.values()]
    assert max(peaks) == pytest.approx(1.0, abs=2e-3)
    assert max(peaks) <= 1.0


def test_feet_sink_no_deeper_than_a_share_of_the_robot_or_a_multiple_of_the_depth_at_rest(
    tmp_path: Path,
) -> None:
    _, problem = drafted(tmp_path, mjcf(FLOOR + DOG, SERVOS))
    assert 2e-3 < problem.objective.constraints["penetration_m"].max < 4e-3  # 0.2 m long
    soft = FLOOR.replace("/>", ' solref="0.1 1"/>')
    (tmp_path / "soft").mkdir()
    _, other = drafted(tmp_path / "soft", mjcf(soft + DOG, SERVOS))
    assert other.objective.constraints["penetration_m"].max > 6e-3


def test_a_limit_that_cannot_hold_yet_is_a_comment(tmp_path: Path) -> None:
    draft, problem = drafted(tmp_path, mjcf(FLOOR + DOG, SERVOS.replace('forcerange="-0.3 0.3"', "")))
    text = problem.source.read_text()
    assert "command_speed_ratio" not in problem.objective.constraints
    assert "# command_speed_ratio = { max = 1.0, scale = 0.3 }  # for servos with a torque limit" in text
    assert any("have no torque limit" in remark for remark in draft.warnings)
    assert problem.file.servo.frame_s == 0.02
    assert "[servo]\nframe_s = 0.02" in text
