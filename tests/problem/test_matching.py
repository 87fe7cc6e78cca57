"""Models that do not match their problem file, and those that MuJoCo refuses."""

from pathlib import Path

import pytest
from helpers import STRIDER, complaint, edited, problem_folder


def rename_actuator(folder: Path) -> None:
    edited(folder / "strider.xml", 'name="front" joint', 'name="fornt" joint')


def swap_actuators(folder: Path) -> None:
    text = (folder / "strider.xml").read_text()
    rear, front = '<position name="rear" joint="rear_hip"/>', '<position name="front" joint="front_hip"/>'
    (folder / "strider.xml").write_text(text.replace(rear, "@").replace(front, rear).replace("@", front))


BAD_MODELS = {
    "no such actuator": (
        rename_actuator,
        "problem.toml: channels.front: ",
        "has no actuator of this name; it has rear, fornt (nearest: 'fornt')",
    ),
    "actuators in another order": (
        swap_actuators,
        "problem.toml: channels: found 'rear, front'; allowed: the model's actuators in order: front, rear",
    ),
    "an actuator more": (
        lambda f: edited(f / "strider.xml", "</actuator>", '<position name="third" joint="pitch"/></actuator>'),  # noqa: E501
        "problem.toml: channels: found 'rear, front'; "
        "allowed: the model's actuators in order: rear, front, third",
    ),
    "the marker is gone": (
        lambda f: edited(f / "strider.xml", 'site name="nose"', 'site name="snout"'),
        "problem.toml: unknown site in roles.marker: 'nose'; known: snout",
    ),
    "broken XML": (
        lambda f: edited(f / "strider.xml", "</worldbody>", "</worldboy>"),
        "strider.xml: broken XML: mismatched tag: line ",
    ),
    "another XML": (
        lambda f: (f / "strider.xml").write_text("<robot/>\n"),
        "strider.xml: root element: found 'robot'; allowed: mujoco",
    ),
    "bad MJCF": (
        lambda f: edited(f / "strider.xml", 'type="sphere"', 'type="ball"'),
        "strider.xml: ",
    ),
    "two models": (
        lambda f: (f / "other.xml").write_text("<mujoco/>"),
        ": found 2 MJCF files (*.xml); allowed: exactly one, or `model`",
    ),
    "no model": (
        lambda f: (f / "strider.xml").unlink(),
        ": found 0 MJCF files (*.xml); allowed: exactly one, or `model`",
    ),
    "an include from outside": (
        lambda f: edited(f / "strider.xml", "<worldbody>", '<include file="../secret.xml"/><worldbody>'),
        "include file: found '../secret.xml'; allowed: a file inside the problem's folder",
    ),
    "an include that is not there": (
        lambda f: edited(f / "strider.xml", "<worldbody>", '<include file="gone.xml"/><worldbody>'),
        "gone.xml: no such file",
    ),
    "a mesh from outside": (
        lambda f: edited(f / "strider.xml", "<worldbody>", '<asset><mesh file="../a.stl"/></asset><worldbody>'),  # noqa: E501
        "strider.xml: mesh file: found '../a.stl'; allowed: a file in the problem's folder",
    ),
    "no keyframe to start from": (
        lambda f: edited(f / "problem.toml", 'name = "strider"', 'name = "strider"\nstart.settle = false'),
        "strider.xml: unknown keyframe 'start'; known: none",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_MODELS)
def test_a_model_that_does_not_fit_is_one_line(tmp_path: Path, name: str) -> None:
    breaks, *expected = BAD_MODELS[name]
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    (tmp_path / "a.stl").write_text("")
    folder = problem_folder(tmp_path / "robot", STRIDER)
    breaks(folder)
    message = complaint(folder)
    assert message.startswith(str(folder))
    for part in expected:
        assert part in message


def test_a_motor_is_no_servo(tmp_path: Path) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    edited(folder / "problem.toml", "actuator/position/@forcerange", "actuator/*/@forcerange")
    xml = edited(folder / "strider.xml", '<position name="front"', '<motor name="front"')
    assert (
        complaint(folder)
        == f"{xml}: actuator front: found 'not a position servo'; allowed: position actuators"
    )
