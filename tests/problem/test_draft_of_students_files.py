"""Three files with a student's mistakes: each edit that they need is asked for, the rest guessed right."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.draft import Draft, make_problem
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator

FILES = Path(__file__).parents[1] / "robots" / "students"


@dataclass(frozen=True)
class Edit:
    """A line of an MJCF: what `new` says before, what the student finds, and what the student writes."""

    asked: str
    found: str
    written: str


SERVO = '<joint damping="0.02" armature="1e-4"/>'

INCHWORM = [
    [
        Edit(
            '<default><joint armature="1e-4" damping="0.02"/></default>',
            "<mujoco>",
            f"<mujoco><default>{SERVO}</default>",
        ),
        Edit(
            'add <geom name="floor" type="plane" size="5 5 0.1"/>',
            "<worldbody>",
            '<worldbody><geom name="floor" type="plane" size="5 5 0.1"/>',
        ),
    ],
    [
        Edit(
            '<default><position forcerange="-0.2 0.2"/></default>',
            f"<default>{SERVO}",
            f'<default>{SERVO}<position forcerange="-0.2 0.2"/>',
        )
    ],
]

SPOT = [
    [
        Edit('<compiler angle="radian"/>', "<default>", '<compiler angle="radian"/><default>'),
        Edit('euler="0 -10 0" in rad', 'euler="0 -10 0"', 'euler="0 -0.175 0"'),
    ],
    [
        Edit(
            'write contype="1" conaffinity="1"',
            'contype="0" conaffinity="0"',
            'contype="1" conaffinity="1"',
        ),
        Edit('<joint damping="0.02" armature="1e-4"/>', "<default>", f"<default>{SERVO}"),
    ],
    [
        Edit(
            "body_shell.stl of shell is missing: put it beside the MJCF, or take the geom out",
            '<geom name="shell" class="visual" type="mesh" mesh="shell"/>',
            "",
        )
    ],
]

BEETLE = [
    [
        Edit(
            "chassis 1.5 kg of it; give its geoms their true mass",
            'size=".13 .05 .025"/>',
            'size=".13 .05 .025" mass="0.3"/>',
        )
    ]
]


def edited(name: str, rounds: list[list[Edit]], folder: Path) -> tuple[Draft, Problem]:
    """Draft until nothing is to be edited, and check that each edit was asked for."""
    text, path = (FILES / name).read_text(), folder / name
    for number, edits in enumerate(rounds):
        path.write_text(text)
        try:
            said = "\n".join(make_problem("robot", path, folder / f"draft-{number}", True).warnings)
        except GaitoptError as error:
            said = str(error)
        for edit in edits:
            assert edit.asked in said
            assert edit.found in text
            text = text.replace(edit.found, edit.written, 1)
    path.write_text(text)
    draft = make_problem("robot", path, folder / "robot", from_motors=True)
    return draft, load_problem(folder / "robot")


def test_an_inchworm_without_ground_names_or_damping(tmp_path: Path) -> None:
    draft, problem = edited("inchworm.xml", INCHWORM, tmp_path)
    assert draft.family == "crawler"
    assert draft.warnings == []
    assert problem.channel_names == ["a", "b"]
    assert problem.roles.forward == (1.0, 0.0, 0.0)
    model = Simulator.build(problem).models[0]
    assert {int(model.geom(pad).type[0]) for pad in problem.roles.pads} == {3}  # capsules: the two feet
    assert len(problem.roles.pads) == 2


@pytest.mark.slow
def test_a_dog_with_radians_motors_a_ramp_and_feet_that_nothing_stops(tmp_path: Path) -> None:
    draft, problem = edited("spot_jr.xml", SPOT, tmp_path)
    assert draft.family == "quadruped"
    assert draft.warnings == []
    assert problem.roles.pads == ["fl_foot", "fr_foot", "bl_foot", "br_foot"]
    assert problem.roles.trunk == "body"
    assert problem.roles.forward == (1.0, 0.0, 0.0)
    assert any("by what is called 'fl'" in remark for remark in draft.remarks)
    assert problem.file.channels["fl_hip_m"].range_deg == pytest.approx((-45.837, 45.837))
    assert problem.file.parameters["torque_limit"].value == pytest.approx(0.18)
    assert list(problem.baselines) == ["trot", "walk", "bound"]


@pytest.mark.slow
def test_a_beetle_too_heavy_for_servos_of_two_kinds_with_a_lamp_on_a_foot(tmp_path: Path) -> None:
    draft, problem = edited("beetle.xml", BEETLE, tmp_path)
    assert draft.family == "hexapod"
    assert problem.roles.forward == (1.0, 0.0, 0.0)
    assert problem.roles.trunk == "chassis"
    legs = [f"{side}{row}_leg" for side in ("left", "right") for row in (1, 2, 3)]
    assert problem.roles.pads == legs
    assert problem.roles.marker == "marker"
    model = Simulator.build(problem).models[0]
    assert model.site("marker").bodyid[0] == model.body("chassis").id
    assert draft.ties is not None
    assert draft.ties.templates == ["tripod"]
