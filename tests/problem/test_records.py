"""The records of a problem file: an error in one is reported in one line."""

from pathlib import Path

import pytest
from helpers import STRIDER, complaint, edited, problem_folder

from gaitopt.problem.problem import Problem

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
    "measured gait that is none": (
        "[baselines.square]",
        '[measured.sqare]\nspeed_m_s = 0.1\norigin = "filmed"\n[baselines.square]',
        "measured: unknown baseline 'sqare'; known: stride, square (nearest: 'square')",
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


@pytest.mark.parametrize(
    ("period_s", "cycles"), [(4.0, (1, 2)), (2.0, (1, 2)), (1.0, (1, 4)), (0.1, (10, 40)), (0.3, (4, 14))]
)
def test_the_horizon_is_whole_cycles(strider: Problem, period_s: float, cycles: tuple[int, int]) -> None:
    """At least 1 s and 1 cycle left out, at least 4 s and 2 cycles measured."""
    assert type(strider.simulation.horizon)().cycles(period_s) == cycles
