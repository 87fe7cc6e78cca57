"""Robots that are held: no free joint, no contacts. And problem files that are like another one."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
import rigs
from helpers import STRIDER, complaint, edited, problem_folder

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.model import build_model, carrying, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.rollout import Simulator

JOINTS = {"mid_act": "mid_left", "foot1": "foot1", "foot2": "foot2"}


@pytest.fixture(scope="module")
def held() -> Problem:
    """ArcFold in the hand."""
    return load_problem("arcfold-held")


def log(problem: Problem) -> LoggedCommands:
    """Commands that bend all three servos, slowly, from a start that was measured."""
    time = np.arange(0.0, 3.0, 0.02)
    waves = [0.6 + 0.4 * np.sin(2.0 * time), -0.7 + 0.4 * np.sin(3.0 * time), -0.7 - 0.4 * np.sin(2.5 * time)]
    start = {"mid_left": 0.6, "foot1": -0.7, "foot2": -0.7}
    return LoggedCommands.of(problem.channel_names, time, np.stack(waves, axis=-1)).recorded(3.0, 0.02, start)


def test_its_joint_angles_follow_logged_commands(held: Problem) -> None:
    path = Simulator.build(held.observing(["end_effector"])).run(log(held))
    assert path.status == "ok"
    for channel, joint in JOINTS.items():
        apart = path[f"joint.{joint}"] - path[f"target.{channel}"]
        assert np.abs(apart).max() < 0.05, channel
    np.testing.assert_allclose(path["joint.mid_right"], path["joint.mid_left"], atol=2e-3)
    assert not path["contacts_all"].any()
    np.testing.assert_array_equal(path["heading.w"], 1.0)
    # The linkage keeps the leading module parallel, and draws it nearer as it bends.
    assert np.abs(path["site.end_effector.pitch"]).max() < 0.01
    reach = np.corrcoef(path["site.end_effector.x"], np.cos(0.5 * path["joint.mid_left"]))[0, 1]
    assert reach > 0.999


def test_without_power_its_hinges_give_way(held: Problem) -> None:
    drive = log(held)
    limp = LoggedCommands.of(held.channel_names, drive.time, np.full_like(drive.rows, math.nan))
    path = Simulator.build(held).run(limp.recorded(3.0, 0.02, drive.start))
    assert path.status == "ok"
    assert path.stacked("torque").max() == 0.0
    assert 0.0 < path["joint.mid_left"][-1] < 0.4  # its springs bear a part of its weight


def test_it_has_the_same_joints_but_the_free_one(held: Problem, arcfold: Problem) -> None:
    model, free = build_model(held), build_model(arcfold)
    names = [model.joint(i).name for i in range(model.njnt)]
    assert ["base", *names] == [free.joint(i).name for i in range(free.njnt)]
    np.testing.assert_allclose(model.body_mass, free.body_mass)
    assert model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    assert model.keyframe("start").qpos.shape == (8,)


def test_what_it_cannot_do_is_not_asked_of_it(held: Problem) -> None:
    assert (held.file.objective, held.file.planar) == (None, None)
    assert (held.roles.marker, held.roles.pads, held.roles.body) == (None, [], [])
    assert held.roles.hinges
    assert not {"speed_m_s", "airtime", "slip_m", "tilt_rad", "penetration_m"} & set(metric_names(held))
    with pytest.raises(GaitoptError, match=r"roles\.marker: none, as the robot is held; a test needs it"):
        held.require("a test", "roles.marker")


@pytest.mark.parametrize(
    ("effect", "value", "why"),
    [
        ("pad_friction", {"scale": 1.1}, "roles.pads"),
        ("contact_compliance", {"scale": 1.1}, "touches nothing"),
        ("payload_mass", {"mass_kg": 0.01}, "the trunk is held"),
        ("com_offset", {"offset_m": 0.01}, "the trunk is held"),
        ("tether_drag", {"force_n": 0.01}, "the trunk is held"),
    ],
)
def test_effects_of_the_ground_do_not_apply(
    held: Problem, effect: str, value: dict[str, float], why: str
) -> None:
    with pytest.raises(GaitoptError, match=f"not applicable: .*{why}"):
        Simulator.build(held.with_effects({effect: value}))


def test_effects_of_servos_and_hinges_apply(held: Problem) -> None:
    drive = log(held)
    nominal = Simulator.build(held).run(drive)
    for effect, value in (("servo_torque_limit", {"limit_n_m": 0.02}), ("hinge_stiffness", {"scale": 30.0})):
        path = Simulator.build(held.with_effects({effect: value})).run(drive)
        assert np.abs(path["joint.mid_left"] - nominal["joint.mid_left"]).max() > 5e-3


def test_a_held_model_is_held_when_it_is_read_again(held: Problem, tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(nominal_mjcf(held))
    (tmp_path / "problem.toml").write_text(held.to_toml("model.xml"))
    again = load_problem(tmp_path)
    usual, other = (Simulator.build(one).run(log(held)) for one in (carrying(held), again))
    np.testing.assert_array_equal(usual["joint.mid_left"], other["joint.mid_left"])


def test_it_is_held_where_the_keyframe_puts_it(tmp_path: Path) -> None:
    mjcf = rigs.sled().replace(
        "</actuator>",
        '</actuator><keyframe><key name="start" qpos="1 2 3 0.7071067811865476 0 0 0.7071067811865475 0"/>'
        '<key name="other" qpos="0 0 1 1 0 0 0 0.5" qvel="0 0 0 0 0 0 1"/></keyframe>',
    )
    folder = tmp_path / "sled"
    rigs.build(folder, mjcf, {"marker": "nose"}, settle=False)
    edited(folder / "problem.toml", "settle = false", "settle = false\nheld = true")
    model = build_model(load_problem(folder))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.body("sled").xpos, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(data.body("sled").xmat[:2], [0.0, -1.0], atol=1e-12)
    assert (model.key("other").qpos.tolist(), model.key("other").qvel.tolist()) == ([0.5], [1.0])


def test_a_free_joint_that_hides_in_a_default_is_refused(tmp_path: Path) -> None:
    mjcf = rigs.sled().replace("<freejoint/>", '<joint class="loose"/>')
    mjcf = mjcf.replace("</default>", '<default class="loose"><joint type="free"/></default></default>', 1)
    folder = tmp_path / "sled"
    rigs.build(folder, mjcf, {"marker": "nose"})
    build_model(load_problem(folder))
    edited(folder / "problem.toml", "settle = true", "settle = true\nheld = true")
    assert complaint(folder).endswith("a free joint has its type from a default")


def test_a_problem_file_may_be_like_one_beside_it(tmp_path: Path) -> None:
    folder = problem_folder(tmp_path / "strider", STRIDER)
    (folder / "weak.toml").write_text(
        'name = "weak"\nlike = "problem.toml"\n[parameters.torque_limit]\nvalue = 0.02\n'
        "[channels.rear]\nrange_deg = [-30.0, 30.0]\n[baselines]\n"
    )
    problem, other = load_problem(folder / "weak.toml"), load_problem(folder)
    assert (problem.name, problem.source) == ("weak", folder / "weak.toml")
    assert problem.model_path == other.model_path
    assert problem.file.parameters["torque_limit"].value == 0.02
    assert problem.file.parameters["torque_limit"].unit == "N m"
    assert problem.file.channels["rear"].range_deg == (-30.0, 30.0)
    assert problem.file.channels["front"] == other.file.channels["front"]
    assert list(problem.baselines) == list(other.baselines)
    assert ET.fromstring(nominal_mjcf(problem)).find("actuator/position").get("forcerange") == "-0.02 0.02"  # type: ignore[union-attr]


def test_it_may_have_an_mjcf_of_its_own(tmp_path: Path) -> None:
    folder = problem_folder(tmp_path / "strider", STRIDER)
    (folder / "other.xml").write_text((folder / "strider.xml").read_text())
    (folder / "weak.toml").write_text('name = "weak"\nlike = "problem.toml"\nmodel = "other.xml"\n')
    edited(folder / "problem.toml", 'name = "strider"', 'name = "strider"\nmodel = "strider.xml"')
    assert load_problem(folder / "weak.toml").model_path == folder / "other.xml"


@pytest.mark.parametrize(
    ("like", "said"),
    [
        (
            '"arcfoldd"',
            "like: found 'arcfoldd'; allowed: a problem file in the same folder, or one of arcfold, ",
        ),
        ('"../problem.toml"', "like: found '../problem.toml'; allowed: a problem file in the same folder"),
        ("3", "like: found 3; allowed: a problem file in the same folder"),
        ('"arcfold-held"', "is itself like another problem; allowed: one that is not"),
        ('"arcfold"\nweight = 3', "weight: unknown key"),
    ],
)
def test_what_it_may_be_like_is_said_in_one_line(like: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "problem.toml").write_text(f'name = "mine"\nlike = {like}\n')
    assert said in complaint(tmp_path)
