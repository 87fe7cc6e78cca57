"""Problems: where they are found, what is said of bad ones, and that they are written back whole."""

import math
from pathlib import Path

import pytest
from helpers import STRIDER, edited, problem_folder, still

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Gait, write_gait
from gaitopt.problem.lookup import bundled_problems
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem

# --- where a problem is found -----------------------------------------------------------------


def test_a_problem_is_a_bundled_name_a_folder_or_a_file(tmp_path: Path) -> None:
    named = load_problem("arcfold")
    assert named.source == bundled_problems() / "arcfold" / "problem.toml"
    assert load_problem(named.source.parent) == named
    assert load_problem(named.source) == named
    other = named.source.parent.joinpath("arcfold.xml").read_text()
    (tmp_path / "arcfold.xml").write_text(other)
    elsewhere = tmp_path / "another-name.toml"
    elsewhere.write_text(named.source.read_text())
    assert load_problem(elsewhere).file == named.file


def test_a_folder_here_comes_before_a_bundled_name() -> None:
    problem_folder(Path("arcfold"), STRIDER)
    assert load_problem("arcfold").name == "strider"


def test_every_bundled_problem_loads() -> None:
    names = [path.parent.name for path in bundled_problems().glob("*/problem.toml")]
    assert {"arcfold", "arcfold-published"} <= set(names)
    for name in names:
        assert load_problem(name).name == name


def test_an_unknown_problem_says_which_exist() -> None:
    assert complaint("arcfoldd") == (
        "arcfoldd: no such problem; allowed: a folder with problem.toml, a problem TOML, "
        "or one of arcfold, arcfold-published"
    )


def test_a_folder_without_a_problem_file_says_so(tmp_path: Path) -> None:
    assert complaint(tmp_path) == f"{tmp_path}: no problem.toml in this folder"


# --- bad problem files ------------------------------------------------------------------------


def complaint(reference: Path | str) -> str:
    """The one line that loading and building a problem ends with."""
    with pytest.raises(GaitoptError) as error:
        build_model(load_problem(reference))
    assert "\n" not in str(error.value)
    return str(error.value)


BAD_FILES = {
    "unknown key": (
        "name = ",
        "naem = 1\nname = ",
        "naem: unknown key; allowed: name, description, model, ",
        "(nearest: 'name')",
    ),
    "unknown key of a parameter": (
        'unit = "N m/rad"',
        'unti = "N m/rad"\nunit = "N m/rad"',
        "parameters.k_servo.unti: unknown key; allowed: value, unit, origin, sets (nearest: 'unit')",
    ),
    "no roles": ("[roles]", "[rolls]", "roles: missing; it is required (and 1 more)"),
    "no amplitudes to search": (
        "amplitude_deg = [0.0, 60.0]\n",
        "",
        "channels.rear.amplitude_deg: missing; [gait] needs it",
    ),
    "not TOML": ("[roles]", "[roles", "not TOML: "),
    "duty outside": (
        "duty = 0.4",
        "duty = 1.4",
        "baselines.square.channels.rear.duty: found 1.4; allowed: less than or equal to 1",
    ),
    "negative period": (
        "period_s = 0.4",
        "period_s = -0.4",
        "baselines.square.period_s: found -0.4; allowed: greater than or equal to 0.001",
    ),
    "NaN": ("value = 0.5", "value = nan", "parameters.k_servo.value: found nan; allowed: a finite number"),
    "bounds the wrong way round": (
        "period_s = [0.25, 1.0]",
        "period_s = [1.0, 0.25]",
        "gait.period_s: found [1.0, 0.25]; allowed: [low, high] with low <= high",
    ),
    "amplitude wider than the travel": (
        "amplitude_deg = [0.0, 60.0]",
        "amplitude_deg = [0.0, 91.0]",
        "channels.rear: amplitude_deg: found 91; allowed: at most the range's 90",
    ),
    "unknown channel of a gait": (
        "front = { duty = 0.6",
        "frnt = { duty = 0.6",
        "baselines.square: unknown channel 'frnt'; known: rear, front (nearest: 'front')",
    ),
    "channel without a wave": (
        "front = { duty = 0.6, phase = 0.75, amplitude_deg = 30.0, offset_deg = -15.0 }",
        "",
        "baselines.square: channels.front: missing; every channel needs a wave",
    ),
    "baseline outside the travel": (
        "amplitude_deg = 40.0, offset_deg = -20.0",
        "amplitude_deg = 70.0, offset_deg = -20.0",
        "baselines.stride: channels.rear: found 'targets from -20 to 50 degrees'; ",
        "allowed: the servo's -45 to 45",
    ),
    "unknown integrator": (
        '1e-3, integrator = "implicitfast"',
        '1e-3, integrator = "implicit-fast"',
        "simulation.reference.integrator: found 'implicit-fast'; allowed: 'Euler', 'RK4', 'implicit' or",
    ),
    "like an unknown baseline": (
        "[baselines.square]\nperiod_s = 0.4\n",
        '[baselines.slow]\nlike = "strid"\nperiod_s = 1.0\n[baselines.square]\nperiod_s = 0.4\n',
        "baselines.slow.like: unknown baseline 'strid'; known: stride, square (nearest: 'stride')",
    ),
    "a target held on no channel": (
        "[gait]",
        "[start]\nctrl_deg = { reer = 1.0 }\n[gait]",
        "start.ctrl_deg: unknown channel 'reer'; known: rear, front (nearest: 'rear')",
    ),
    "a constraint without a limit": (
        "airtime = { max = 0.2, scale = 0.1 }",
        "airtime = { scale = 0.1 }",
        "objective.constraints.airtime: allowed: `max`, `min` or both",
    ),
    "no direction of travel": ("forward = [0, 1, 0]", "forward = [0, 0, 0]", "forward"),
    "travel straight up": ("forward = [0, 1, 0]", "forward = [0, 0, 2]", "forward"),
    "no up": ("up = [0, 0, 1]", "up = [0, 0, 0]", "up"),
    "an actuator that is not there": (
        "[channels.rear]",
        "[channels.reer]",
        "unknown channel 'rear'",
    ),
    "a model outside the folder": (
        'name = "strider"',
        'name = "strider"\nmodel = "../strider.xml"',
        "model: found '../strider.xml'; allowed: a file inside the problem's folder",
    ),
    "a model that is not there": (
        'name = "strider"',
        'name = "strider"\nmodel = "gone.xml"',
        "model: ",
        "gone.xml: no such file",
    ),
    "a site that is not there": (
        'marker = "nose"',
        'marker = "noes"',
        "unknown site in roles.marker: 'noes'; known: nose (nearest: 'nose')",
    ),
    "a pad that is not there": (
        'pads = ["rear_foot", ',
        'pads = ["rear_fot", ',
        "unknown geom in roles.pads: 'rear_fot'; known: floor, trunk, ",
        "(nearest: 'rear_foot')",
    ),
    "a hinge that is not there": (
        'marker = "nose"',
        'marker = "nose"\nhinges = ["rear_hop"]',
        "unknown joint in roles.hinges: 'rear_hop'",
        "(nearest: 'rear_hip')",
    ),
    "a path that finds nothing": (
        'sets = ["actuator/position/@kp"]',
        'sets = ["actuator/velocity/@kp"]',
        "parameters.k_servo.sets: path: found 'actuator/velocity/@kp'; allowed: an XPath",
    ),
    "a path without an attribute": (
        'sets = ["actuator/position/@kp"]',
        'sets = ["actuator/position"]',
        "parameters.k_servo.sets: path: found 'actuator/position'; allowed: an XPath that ends in /@attribute",  # noqa: E501
    ),
    "a path that is broken": (
        'sets = ["actuator/position/@kp"]',
        'sets = ["actuator/position[/@kp"]',
        "parameters.k_servo.sets: path: found 'actuator/position[/@kp'; allowed: an XPath",
    ),
    "a path of nonsense": (
        'sets = ["actuator/position/@kp"]',
        'sets = ["*]/@kp"]',
        "parameters.k_servo.sets: path: found '*]/@kp'; allowed: an XPath",
    ),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_bad_problem_file_is_one_line(tmp_path: Path, name: str) -> None:
    old, new, *expected = BAD_FILES[name]
    folder = problem_folder(tmp_path / "robot", STRIDER)
    path = folder / "problem.toml"
    path.write_text((STRIDER / "problem.toml").read_text())
    message = complaint(edited(path, old, new))
    assert message.startswith(f"{path}: ")
    for part in expected:
        assert part in message


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


def test_includes_are_resolved_inside_the_folder(tmp_path: Path, strider: Problem) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    text = (folder / "strider.xml").read_text()
    begin, end = text.index("<actuator>"), text.index("</actuator>") + len("</actuator>")
    (folder / "servos").mkdir()
    (folder / "servos" / "two.xml").write_text(f"<mujoco>{text[begin:end]}</mujoco>")
    (folder / "strider.xml").write_text(text[:begin] + '<include file="servos/two.xml"/>' + text[end:])
    included, whole = build_model(load_problem(folder)), build_model(strider)
    assert included.actuator_gainprm.tolist() == whole.actuator_gainprm.tolist()
    assert included.key_qpos.tolist() == whole.key_qpos.tolist()


# --- named parameters -------------------------------------------------------------------------


def test_setting_a_parameter_changes_it_alone(strider: Problem) -> None:
    changed = strider.with_parameters({"mu_rear": 0.1 + 0.2})
    assert changed.file.parameters["mu_rear"].value == 0.1 + 0.2
    assert strider.file.parameters["mu_rear"].value == 1.0
    back = changed.with_parameters({"mu_rear": 1.0})
    assert back == strider
    assert load_problem(STRIDER, {"mu_rear": 0.1 + 0.2}) == changed
    assert strider.with_parameters({}) == strider


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"mu_raer": 1.0},
            "unknown parameter 'mu_raer'; known: k_servo, b_servo, torque_limit, mu_rear, mu_front, "
            "mu_trunk, mass (nearest: 'mu_rear')",
        ),
        ({"mu_rear": math.nan}, "parameters.mu_rear.value: found nan; allowed: a finite number"),
        ({"mu_rear": math.inf}, "parameters.mu_rear.value: found inf; allowed: a finite number"),
    ],
)
def test_a_bad_parameter_is_one_line(strider: Problem, values: dict[str, float], message: str) -> None:
    with pytest.raises(GaitoptError) as error:
        strider.with_parameters(values)
    assert str(error.value) == f"{strider.source}: {message}"


def test_a_value_that_no_robot_has_is_one_line(tmp_path: Path, strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"strider\.xml: ") as error:
        build_model(strider.with_parameters({"mass": -1.0}))
    assert "\n" not in str(error.value)


# --- there and back ---------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["arcfold", "arcfold-published", STRIDER])
def test_a_written_problem_file_is_the_same_problem(tmp_path: Path, robot: Path | str) -> None:
    problem = load_problem(robot)
    written = tmp_path / "problem.toml"
    written.write_text(problem.to_toml("robot.xml"))
    (tmp_path / "robot.xml").write_bytes(problem.model_path.read_bytes())
    back = load_problem(written)
    assert back.file.model_copy(update={"model": problem.file.model}) == problem.file
    assert back.baselines == problem.baselines
    assert back.space == problem.space
    assert back.channel_names == problem.channel_names


# --- gaits of a problem -----------------------------------------------------------------------


def test_a_gait_is_a_baseline_a_file_or_a_run_folder(tmp_path: Path, strider: Problem) -> None:
    gait = strider.baselines["square"]
    assert strider.find_gait("square") == gait
    write_gait(tmp_path / "best.toml", gait)
    assert strider.find_gait(str(tmp_path / "best.toml")).channels == gait.channels
    assert strider.find_gait(str(tmp_path)).channels == gait.channels


def test_a_gait_takes_the_problems_order_of_channels(strider: Problem) -> None:
    gait = strider.baselines["square"]
    turned = Gait(gait.period_s, dict(reversed(gait.channels.items())), gait.name)
    assert list(strider.check_gait(turned, "turned").channels) == strider.channel_names


def test_a_gait_that_is_not_there_says_what_is(tmp_path: Path, strider: Problem) -> None:
    with pytest.raises(GaitoptError) as error:
        strider.find_gait("sqare")
    assert str(error.value) == (
        "sqare: neither a baseline nor a gait file nor an exported table nor a run folder; "
        "baselines: stride, square"
    )
    with pytest.raises(GaitoptError, match=r"best\.toml: no such file; .* is not a finished run folder"):
        strider.find_gait(str(tmp_path))


def test_another_robots_gait_is_one_line(tmp_path: Path, strider: Problem, arcfold: Problem) -> None:
    write_gait(tmp_path / "gait.toml", still(arcfold))
    with pytest.raises(GaitoptError) as error:
        strider.find_gait(str(tmp_path / "gait.toml"))
    assert str(error.value) == (
        f"{tmp_path / 'gait.toml'}: unknown channel '{arcfold.channel_names[0]}'; known: rear, front"
    )


@pytest.mark.parametrize(
    ("period_s", "cycles"), [(4.0, (1, 2)), (2.0, (1, 2)), (1.0, (1, 4)), (0.1, (10, 40)), (0.3, (4, 14))]
)
def test_the_horizon_is_whole_cycles(strider: Problem, period_s: float, cycles: tuple[int, int]) -> None:
    """At least 1 s and 1 cycle thrown away, at least 4 s and 2 cycles measured."""
    assert type(strider.simulation.horizon)().cycles(period_s) == cycles
