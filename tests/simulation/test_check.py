"""The audit: the same findings on every executor, progress, and a remedy for each kind."""

from pathlib import Path

import pytest
from helpers import ROBOTS, problem_folder

from gaitopt.core.progress import Progress
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.audit.finding import FINDING_KINDS, Finding
from gaitopt.simulation.audit.motion import check_motion
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.check import check

STRICT = CheckSettings(
    rest_s=0.2,
    rest_joint_rad_s=0.0,
    parameter_s=0.2,
    airtime=-1.0,
    sideways_ratio=-1.0,
    reached=2.0,
    growth=0.0,
    starts=2,
    timestep_change=-100.0,
    timestep_floor_m_s=-1.0,
)
"""Settings that are quick, and so strict that a good robot has findings of almost every kind."""


@pytest.fixture(scope="module")
def expected(strider: Problem) -> list[Finding]:
    return check(strider, SerialExecutor(), STRICT)


def test_strict_limits_find_something_of_every_kind(expected: list[Finding]) -> None:
    assert {finding.name for finding in expected} == {
        "unrest_at_start",
        "inert_parameter",
        "airtime",
        "sideways_drift",
        "chaos",
        "command_not_followed",
        "timestep_convergence",
    }


@pytest.mark.parametrize("where", ["threads", "processes"])
def test_findings_do_not_depend_on_the_executor(where: str, expected: list[Finding], tmp_path: Path) -> None:
    """Workers need no file of the problem's, and give the same bits."""
    folder = problem_folder(tmp_path / "strider", ROBOTS / "strider")
    problem = carrying(load_problem(folder))
    for file in (path for path in folder.iterdir() if path.is_file()):
        file.unlink()
    with open_executor(where, 2) as executor:
        assert check(problem, executor, STRICT) == expected


@pytest.mark.slow
def test_a_robot_with_effects_is_checked_in_other_processes(strider: Problem) -> None:
    """Effects are sent to workers by name, those with hooks, loops and commands too."""
    effects = {"servo_sag": {"share_lost": 0.1}, "command_latency": {"delay_s": 0.01}}
    problem = carrying(strider.with_effects(effects))
    with open_executor("processes", 2) as executor:
        assert check(problem, executor, STRICT) == check(problem, SerialExecutor(), STRICT)


def test_each_check_reports_its_progress(strider: Problem) -> None:
    told: list[Progress] = []
    check(strider, SerialExecutor(), STRICT, told.append)
    assert [step.stage for step in told] == ["rest at the start", "inert parameters", "gaits", "timestep"]


def test_every_finding_has_a_remedy(expected: list[Finding]) -> None:
    assert {finding.remedy for finding in expected} <= {kind.remedy for kind in FINDING_KINDS.values()}
    assert all(len(kind.remedy) > 20 for kind in FINDING_KINDS.values())


def test_a_timestep_that_servos_are_too_stiff_for_is_found_with_one_that_is_not(strider: Problem) -> None:
    """The angles tell it, where the speed is the same by chance; with the timestep that is named, nothing."""

    def found(problem: Problem) -> list[Finding]:
        return list(check_motion(problem, SerialExecutor(), CheckSettings(), ()))

    (coarse,) = found(strider)
    assert coarse.name == "timestep_convergence"
    assert "take 0.0005 s" in coarse.message
    fine = Fidelity(timestep_s=0.0005, integrator=strider.simulation.working.integrator)
    settings = strider.simulation.model_copy(update={"working": fine})
    file = strider.file.model_copy(update={"simulation": settings})
    assert found(Problem.from_file(file, strider.source, strider.model_path)) == []


def test_a_gait_that_is_known_to_have_diverged_is_not_judged_by_its_angles(strider: Problem) -> None:
    assert list(check_motion(strider, SerialExecutor(), CheckSettings(), list(strider.baselines))) == []
