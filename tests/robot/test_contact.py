"""MuJoCo's rules of contact: gaitopt's reading of them agrees with MuJoCo."""

import mujoco
import numpy as np
import pytest

from gaitopt.robot.contact import can_touch, can_touch_ground, mixed_friction
from gaitopt.robot.tree import surroundings

ROBOT = """<mujoco><worldbody>
  <geom name="ground" type="plane" size="5 5 1" {ground}/>
  <body pos="0 0 0.09"><freejoint/><geom name="ball" size="0.1" {ball}/></body>
</worldbody></mujoco>"""


def robot(ground: str, ball: str) -> mujoco.MjModel:
    """A ball that overlaps the ground by a centimetre."""
    return mujoco.MjModel.from_xml_string(ROBOT.format(ground=ground, ball=ball))


def contacts(model: mujoco.MjModel) -> list[list[float]]:
    """The friction of each contact that MuJoCo finds."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return [data.contact[i].friction.tolist() for i in range(data.ncon)]


@pytest.mark.parametrize(("types", "affinities"), [((1, 1), (1, 1)), ((1, 0), (0, 1)), ((2, 1), (4, 8))])
def test_geoms_touch_where_mujoco_finds_a_contact(
    types: tuple[int, int], affinities: tuple[int, int]
) -> None:
    masks = [f'contype="{t}" conaffinity="{a}"' for t, a in zip(types, affinities, strict=True)]
    model = robot(*masks)
    ground, ball = model.geom("ground").id, model.geom("ball").id
    assert surroundings(model) == [ground]
    touching = bool(contacts(model))
    assert can_touch(model, ball, ground) == can_touch(model, ground, ball) == touching
    assert can_touch_ground(model, ball) == touching


@pytest.mark.parametrize("priorities", [(0, 0), (1, 0), (0, 1)])
def test_friction_mixes_as_in_mujocos_contact(priorities: tuple[int, int]) -> None:
    model = robot(
        f'friction="0.3 0.02 0.0001" priority="{priorities[0]}"',
        f'friction="0.9 0.01 0.0002" priority="{priorities[1]}"',
    )
    (found,) = contacts(model)
    slide, spin, roll = mixed_friction(model, model.geom("ball").id, model.geom("ground").id)
    assert found == [slide, slide, spin, roll, roll]
    assert np.array_equal(mixed_friction(model, 0, 1), mixed_friction(model, 1, 0))
