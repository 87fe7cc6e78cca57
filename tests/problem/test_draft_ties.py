"""Drafted ties: legs are named and mirrored as the MJCF has them, and a robot without such legs gets none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaitopt.problem.draft import Draft, make_problem
from gaitopt.problem.problem import Problem, load_problem

LEG = """
<body pos="{x} {y} 0">
  <joint name="roll_{n}" axis="{roll} 0 0" range="-30 30" damping="0.02" armature="1e-4"/>
  <joint name="hip_{n}" axis="0 {pitch} 0" range="-40 40" damping="0.02" armature="1e-4"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.05" size="0.006" mass="0.01"/>
  <geom type="sphere" pos="0 0 -0.055" size="0.008" mass="0.002"/>
</body>
"""
FLOOR = '<geom type="plane" size="5 5 0.1"/>'
SERVO = '<position name="{name}" joint="{name}" kp="4" forcerange="-0.3 0.3"/>'


def drafted(folder: Path, body: str, joints: list[str]) -> tuple[Draft, Problem]:
    """The draft of a robot."""
    servos = "".join(SERVO.format(name=name) for name in joints)
    path = folder / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{FLOOR}{body}</worldbody><actuator>{servos}</actuator></mujoco>")
    draft = make_problem("mine", path, folder / "mine")
    return draft, load_problem(folder / "mine")


def walker(
    folder: Path, corners: dict[str, tuple[float, float]], **turned: tuple[float, float]
) -> tuple[Draft, Problem]:
    """A robot with legs at some corners, whose axes may be turned round: of roll and of pitch."""
    legs = ""
    for name, (x, y) in corners.items():
        roll, pitch = turned.get(name, (1.0, 1.0))
        legs += LEG.format(n=name, x=x, y=y, roll=roll, pitch=pitch)
    trunk = f'<geom type="box" size="0.1 0.03 0.015" mass="0.1"/>{legs}'
    joints = [f"{kind}_{name}" for name in corners for kind in ("roll", "hip")]
    return drafted(folder, f'<body name="trunk" pos="0 0 0.08"><freejoint/>{trunk}</body>', joints)


FOUR = {"a": (0.06, 0.04), "b": (0.06, -0.04), "c": (-0.06, 0.04), "d": (-0.06, -0.04)}


def test_legs_of_a_quadruped_are_named_and_mirrored_as_its_axes_are(tmp_path: Path) -> None:
    draft, problem = walker(tmp_path, FOUR, c=(-1.0, 1.0), d=(1.0, -1.0))
    assert draft.ties is not None
    assert draft.ties.legs == {
        "front_left": ["roll_a", "hip_a"],
        "front_right": ["roll_b", "hip_b"],
        "hind_left": ["roll_c", "hip_c"],
        "hind_right": ["roll_d", "hip_d"],
    }
    assert set(draft.ties.mirrored) == {"roll_b", "roll_c", "roll_d", "hip_d"}
    assert [space.name for space in problem.tied_spaces] == ["trot", "walk", "bound"]
    trot = problem.tied_spaces[0]
    assert len(trot.variables) == 10 < len(problem.space.variables)
    gait = trot.decode(np.array([0.5, 0.3, 0.7, 0.1, 0.4, 0.6, 0.2, 0.8, 0.9, 0.5]))
    time = np.linspace(0.0, gait.period_s, 40)
    later = time + 0.5 * gait.period_s
    roll_a, hip_a, roll_b, hip_b, *_, roll_d, hip_d = gait.targets(time, 0.0).T
    assert np.allclose(gait.targets(later, 0.0)[:, 2:4].T, [-roll_a, hip_a], atol=1e-6)
    assert np.allclose([roll_d, hip_d], [-roll_a, -hip_a], atol=1e-6)
    assert not np.allclose(hip_b, hip_a)
    assert not np.allclose(roll_b, -roll_a)


def test_six_legs_get_a_tripod(tmp_path: Path) -> None:
    six = {f"{row}{side}": (x, y) for row, x in (("f", 0.08), ("m", 0.0), ("h", -0.08))
           for side, y in (("l", 0.05), ("r", -0.05))}  # fmt: skip
    draft, problem = walker(tmp_path, six)
    assert draft.ties is not None
    assert list(draft.ties.legs) == [
        "front_left", "front_right", "middle_left", "middle_right", "hind_left", "hind_right",
    ]  # fmt: skip
    assert [space.name for space in problem.tied_spaces] == ["tripod"]
    assert len(problem.tied_spaces[0].variables) == 10


@pytest.mark.parametrize("sign", ["1", "-1"])
def test_a_body_that_undulates_gets_one_wave(tmp_path: Path, sign: str) -> None:
    body = ""
    for i in reversed(range(5)):
        axis = f"0 0 {sign if i == 2 else 1}"
        joint = f'<joint name="j{i}" axis="{axis}" range="-60 60" damping="0.02" armature="1e-4"/>'
        geom = '<geom type="capsule" fromto="0 0 0 -0.05 0 0" size="0.012" mass="0.03"/>'
        body = f'<body pos="-0.05 0 0">{joint}{geom}{body}</body>'
    head = '<freejoint/><geom type="capsule" fromto="0 0 0 -0.05 0 0" size="0.012" mass="0.03"/>'
    draft, problem = drafted(
        tmp_path, f'<body name="head" pos="0 0 0.012">{head}{body}</body>', [f"j{i}" for i in range(5)]
    )
    assert draft.family == "snake"
    assert draft.ties is not None
    assert draft.ties.legs == {"spine": [f"j{i}" for i in range(5)]}
    assert draft.ties.mirrored == (["j2"] if sign == "-1" else [])
    assert [variable.name for variable in problem.tied_spaces[0].variables][-1] == "shifts.lag"


def test_legs_that_differ_get_no_ties(tmp_path: Path) -> None:
    legs = "".join(LEG.format(n=n, x=x, y=y, roll=1, pitch=1) for n, (x, y) in FOUR.items())
    other = legs.replace('name="hip_d" axis="0 1 0"', 'name="hip_d" axis="0 0 1"')
    trunk = f'<geom type="box" size="0.1 0.03 0.015" mass="0.1"/>{other}'
    joints = [f"{kind}_{name}" for name in FOUR for kind in ("roll", "hip")]
    draft, problem = drafted(
        tmp_path, f'<body name="trunk" pos="0 0 0.08"><freejoint/>{trunk}</body>', joints
    )
    assert draft.ties is None
    assert not problem.tied_spaces
    assert '# hip_d = { like = "roll_a", shift = 0.5 }' in (tmp_path / "mine" / "problem.toml").read_text()
