"""The audit says first what a person sees first: no ground, a robot that does not stand, one that falls."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from gaitopt.cli import app as cli
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.audit.finding import Finding
from gaitopt.simulation.check import check

FLOOR = '<geom name="floor" type="plane" size="5 5 0.1"/>'
MJCF = """
<mujoco><worldbody>{floor}
  <body name="trunk" pos="0 0 0.2"><freejoint/>
    <geom name="trunk" type="box" size="0.02 0.02 0.05" mass="0.5" pos="0 0 0.05"/><site name="marker"/>
    {legs}
  </body>
</worldbody><actuator>{servos}</actuator></mujoco>
"""
LEG = """
<body pos="{x} 0 0"><joint name="{n}" axis="0 1 0" damping="0.01" armature="1e-4"/>
  <geom name="{n}" type="box" size="0.02 {width} 0.05" pos="0 0 -0.05" mass="0.05" priority="1"/></body>
"""
PROBLEM = """
name = "tower"
model = "robot.xml"
roles = {{ marker = "marker", pads = ["fore", "hind"] }}
start.ctrl_deg = {{ fore = {start}, hind = {start} }}
channels = {{ fore = {{ range_deg = [-90, 90] }}, hind = {{ range_deg = [-90, 90] }} }}
[baselines.bow]
period_s = 1.0
[baselines.bow.channels]
fore = {{ duty = 0.5, phase = 0.0, amplitude_deg = {swing}, offset_deg = {start} }}
hind = {{ duty = 0.5, phase = 0.0, amplitude_deg = {swing}, offset_deg = {start} }}
[simulation]
working = {{ timestep_s = 1e-3, integrator = "implicitfast" }}
reference = {{ timestep_s = 1e-3, integrator = "implicitfast" }}
"""


def tower(
    folder: Path, floor: str = FLOOR, limit: float = 2.0, start: float = 0.0, swing: float = 1.0
) -> Problem:
    legs = "".join(LEG.format(n=n, x=x, width=0.05) for n, x in (("fore", 0.04), ("hind", -0.04)))
    servos = "".join(
        f'<position name="{n}" joint="{n}" kp="10" forcerange="-{limit} {limit}"/>' for n in ("fore", "hind")
    )
    (folder / "robot.xml").write_text(MJCF.format(floor=floor, legs=legs, servos=servos))
    (folder / "problem.toml").write_text(PROBLEM.format(start=float(start), swing=float(swing)))
    return load_problem(folder)


def found(problem: Problem) -> list[Finding]:
    with ThreadPoolExecutor(1) as pool:
        return check(problem, pool)


def test_a_robot_that_stands_has_none_of_these(tmp_path: Path) -> None:
    names = {finding.name for finding in found(tower(tmp_path))}
    assert not names & {"no_ground", "does_not_stand", "fell_over"}


@pytest.mark.parametrize("floor", ["", FLOOR.replace("/>", ' contype="0" conaffinity="0"/>')])
def test_no_ground_is_the_first_finding(tmp_path: Path, floor: str) -> None:
    first = found(tower(tmp_path, floor))[0]
    assert first.name == "no_ground"
    assert "falls for ever" in first.message
    assert '<geom name="floor"' in first.remedy


@pytest.mark.slow
def test_a_robot_in_water_is_not_in_the_air(tmp_path: Path) -> None:
    water = '<option density="1000" viscosity="1e-3" gravity="0 0 0"/>'
    for more, named in ((water, False), (water.replace("1000", "1.2"), True)):
        problem = tower(tmp_path, "")
        mjcf = tmp_path / "robot.xml"
        mjcf.write_text(mjcf.read_text().replace("<mujoco>", f"<mujoco>{more}"))
        names = {finding.name for finding in found(load_problem(problem.source))}
        assert ("airtime" in names) == named
        assert "no_ground" not in names  # nothing pulls it down


@pytest.mark.slow
def test_weak_servos_do_not_carry_the_robot(tmp_path: Path) -> None:
    names = [finding.name for finding in found(tower(tmp_path, limit=0.005, start=40.0))]
    assert names[0] == "does_not_stand"


def test_a_robot_that_lies_at_its_start_does_not_stand(tmp_path: Path) -> None:
    findings = found(tower(tmp_path, start=75.0))
    assert findings[0].name == "does_not_stand"
    assert "tilted by" in findings[0].message


@pytest.mark.slow
def test_a_gait_that_throws_the_robot_over_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tower(tmp_path, swing=75.0)
    assert cli.main(["check", str(tmp_path), "--workers", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("fell_over at bow: it fell over")
    assert any(line.startswith("to do about fell_over: Make the gait slower") for line in lines)
