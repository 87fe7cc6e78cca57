"""`gaitopt new`: a problem file drafted from any robot's MJCF."""

from pathlib import Path

import pytest
from helpers import STRIDER

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.problem.draft import make_problem
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator


def nominal(problem: Problem, folder: Path) -> Path:
    path = folder / f"{problem.name}.xml"
    path.write_text(nominal_mjcf(problem))
    return path


def test_two_robots_walk_from_their_mjcf_alone(
    arcfold: Problem, strider: Problem, tmp_path: Path, in_a_folder_of_its_own: Path
) -> None:
    for known in (arcfold, strider):
        make_problem("mine", nominal(known, tmp_path), tmp_path / f"mine-{known.name}")
        drafted = load_problem(tmp_path / f"mine-{known.name}")
        assert drafted.channel_names == known.channel_names
        for role in ("pads", "forward", "up"):
            assert getattr(drafted.roles, role) == getattr(known.roles, role)
        assert drafted.roles.marker in ("nose", "base_tag")  # a site of the trunk
        assert set(drafted.roles.body) >= set(known.roles.body)
        simulator = Simulator.build(drafted)
        gait = drafted.baselines["first-guess"]
        trajectory = simulator.run(gait, duration=simulator.duration(gait))
        assert trajectory.status == "ok"
        assert measure(drafted, gait, trajectory, Robot.of(simulator.models[0]))["reached"] > 0.2


def test_parameters_are_the_models_own(arcfold: Problem, tmp_path: Path) -> None:
    make_problem("mine", nominal(arcfold, tmp_path), tmp_path / "mine")
    parameters = load_problem(tmp_path / "mine").file.parameters
    known = arcfold.file.parameters
    for drafted, original in (
        ("k_servo", "k_motor"),
        ("torque_limit", "torque_limit"),
        ("mu_pads", "mu_tape"),
    ):
        assert parameters[drafted].value == known[original].value
        assert parameters[drafted].unit == known[original].unit


def test_passive_hinges_are_those_without_a_servo(arcfold: Problem, tmp_path: Path) -> None:
    draft = make_problem("mine", nominal(arcfold, tmp_path), tmp_path / "mine")
    assert sorted(draft.roles.hinges) == sorted(set(arcfold.roles.hinges) - {"mid_left"})


def test_the_file_says_what_was_guessed_and_what_comes_next(
    tmp_path: Path, strider: Problem, capsys: pytest.CaptureFixture[str]
) -> None:
    path = nominal(strider, tmp_path)
    assert cli.main(["new", "mine", "--mjcf", str(path)]) == 0
    text = (Path("mine") / "problem.toml").read_text()
    assert "assumed" in text
    assert "Guessed" in text
    assert "gaitopt optimise mine" in capsys.readouterr().out


LEG = '<body><joint name="j" damping="0.01"/><geom size="0.1"/></body>'
FLOOR = '<geom type="plane" size="1 1 1"/>'
BODY = f'{FLOOR}<body pos="0 0 0.2"><freejoint/><geom size="0.1"/>{LEG}</body>'
SERVO = '<position joint="j"/>'


@pytest.mark.parametrize(
    ("world", "actuators", "said"),
    [
        (BODY, "", "no actuators"),
        (BODY, '<motor name="m" joint="j" gear="2" ctrlrange="-1 1"/>', "--from-motors"),
        (BODY, '<velocity name="v" joint="j"/>', "v: not a position servo"),
        (BODY.replace(FLOOR, ""), SERVO, 'there is no ground.*<geom name="floor" type="plane"'),
        (
            BODY.replace('size="0.1"', 'size="0.1" contype="0"'),
            SERVO.replace("/>", ' ctrlrange="-30 30"/>'),
            "rad",
        ),
        ("<body>", "", "XML"),
    ],
)
def test_one_line_says_what_is_missing(tmp_path: Path, world: str, actuators: str, said: str) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{world}</worldbody><actuator>{actuators}</actuator></mujoco>")
    with pytest.raises(GaitoptError, match=said):
        make_problem("mine", path, tmp_path / "mine")
    assert not (tmp_path / "mine").exists()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes").write_text("mine")
    with pytest.raises(GaitoptError, match="not empty"):
        make_problem("mine", STRIDER / "strider.xml", tmp_path / "mine")
    with pytest.raises(GaitoptError, match="NAME"):
        make_problem("../mine", STRIDER / "strider.xml", tmp_path / "other")
