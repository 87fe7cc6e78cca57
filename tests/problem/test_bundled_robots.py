"""The bundled quadruped and snake: drafted by `gaitopt new`, and hardly edited."""

from pathlib import Path

import pytest

from gaitopt.gait.gait import Gait
from gaitopt.problem.draft import make_problem
from gaitopt.problem.lookup import bundled_names
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import Metrics, measure
from gaitopt.simulation.rollout import Simulator

ROBOTS = ("quadruped", "snake")


def walked(problem: Problem, gait: str | Gait) -> Metrics:
    simulator = Simulator.build(problem)
    drive = problem.baselines[gait] if isinstance(gait, str) else gait
    return measure(problem, drive, simulator.run(drive), Robot.of(simulator.models[0]))


def stride(problem: Problem, gait: Gait) -> float:
    return walked(problem, gait)["speed_m_s"] * gait.period_s


@pytest.mark.parametrize("name", ROBOTS)
def test_the_draft_guesses_what_the_bundled_file_says(name: str, tmp_path: Path) -> None:
    assert name in bundled_names()
    bundled = load_problem(name)
    draft = make_problem(name, bundled.source.parent / f"{name}.xml", tmp_path / name)
    again = load_problem(tmp_path / name)
    assert draft.family == name
    assert draft.changes == []
    assert again.roles == bundled.roles
    assert list(again.baselines) == list(bundled.baselines)
    assert [space.name for space in again.tied_spaces] == [space.name for space in bundled.tied_spaces]


@pytest.mark.parametrize("name", ROBOTS)
def test_every_number_says_where_it_comes_from(name: str) -> None:
    origins = [one.origin for one in load_problem(name).file.parameters.values()]
    assert all(origin.startswith(("datasheet: ", "assumed: ", "as in ")) for origin in origins)


@pytest.mark.parametrize(
    ("name", "gait", "least"), [("quadruped", "walk", 0.02), ("snake", "undulation", 0.1)]
)
def test_it_goes_forward_on_its_feet(name: str, gait: str, least: float) -> None:
    walk = walked(load_problem(name), gait)
    assert walk["speed_m_s"] > least
    assert walk.get("airtime", 0.0) < 0.02
    assert walk["tilt_rad"] < 0.4


def test_friction_of_an_mjcf_without_priorities_changes_the_walk() -> None:
    problem = load_problem("quadruped")
    speeds = [walked(problem.with_parameters({"mu_pads": mu}), "walk")["speed_m_s"] for mu in (0.3, 0.6, 1.0)]
    assert all(abs(a - b) > 1e-4 for i, a in enumerate(speeds) for b in speeds[:i])


def test_friction_helps_uphill_until_the_feet_hold() -> None:
    uphill = load_problem("quadruped").with_effects({"ground_slope": {"angle_rad": 0.14}})
    speeds = [walked(uphill.with_parameters({"mu_pads": mu}), "walk")["speed_m_s"] for mu in (0.2, 0.3, 0.5)]
    assert speeds[0] < speeds[1] < 0.0 < speeds[2]


def test_one_coefficient_of_all_feet_cancels_out_of_a_slow_walk() -> None:
    """Feet that slide slowly are in balance, and each force is proportional to it."""
    problem = load_problem("quadruped")
    trot = problem.baselines["trot"]
    spread = []
    for times in (1, 8):
        slow = trot.with_period(times * trot.period_s)
        strides = [stride(problem.with_parameters({"mu_pads": mu}), slow) for mu in (0.1, 0.5)]
        spread.append(max(strides) / min(strides))
    assert spread[0] > 1.3
    assert spread[1] < 1.12


def test_wheels_that_slip_sideways_push_less() -> None:
    problem = load_problem("snake")
    speeds = [
        walked(problem.with_parameters(mu), "undulation")["speed_m_s"] for mu in ({"mu_pads": 0.03}, {})
    ]
    assert speeds[0] < 0.8 * speeds[1]
