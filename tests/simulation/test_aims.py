"""Aims beyond forward speed: turning, a wanted speed, distance per charge, straightness."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import STRIDER, problem_folder, still

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.problem.objective import Objective
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.labels import label_of
from gaitopt.simulation.metrics import AIMS, measure, metric_names
from gaitopt.simulation.objective import check_objective, evaluate

TIME = np.arange(1501.0) * 1e-3
ROBOT = Robot(2.0, np.full(3, 0.1), np.full(3, 0.0), np.full(3, 10.0))


def aiming(problem: Problem, terms: dict[str, float], **more: object) -> Problem:
    """The problem with another objective."""
    objective = Objective.model_validate({"terms": terms, **more})
    file = problem.file.model_copy(update={"objective": objective})
    return Problem.from_file(file, problem.source, problem.model_path)


def walked(
    problem: Problem, speed: float, side: float = 0.0, yaw: float = 0.0, power: float = 0.0
) -> dict[str, float]:
    """The metrics of a walk: its speed, how far it goes aside, its turning rate and the power of a servo."""
    names = [
        f"{kind}.{c}" for kind in ("target", "position", "rate", "torque") for c in problem.channel_names
    ]
    names += [f"{kind}.{p}.{a}" for kind in ("load", "pad_speed") for p in problem.roles.pads for a in "xyz"]
    signals = {name: np.zeros(len(TIME)) for name in [*names, *(f"heading.{a}" for a in "xy"), "marker.z"]}
    half = 0.5 * yaw * TIME
    signals |= {"heading.w": np.cos(half), "heading.z": np.sin(half), "depth": np.zeros(len(TIME))}
    signals |= {"contacts": np.full(len(TIME), 2.0), "contacts_all": np.full(len(TIME), 2.0)}
    signals |= {"marker.x": speed * TIME, "marker.y": side * np.abs((TIME - 0.5) % 1.0 - 0.5)}
    first = problem.channel_names[0]
    signals |= {
        f"torque.{first}": np.full(len(TIME), 0.05),
        f"rate.{first}": np.full(len(TIME), power / 0.05),
    }
    return measure(problem, still(problem, 0.5), Trajectory(TIME, signals), ROBOT)


def test_aims_that_are_not_named_change_no_problem(quick: Problem) -> None:
    assert not set(AIMS) & set(metric_names(quick))
    assert set(AIMS) <= set(metric_names(quick, unused=True))
    assert not set(AIMS) & set(walked(quick, 0.1))
    assert "wanted_speed_m_s" not in quick.to_dict()["objective"]


@pytest.mark.parametrize("rate", [-0.6, 0.4])
def test_turning_has_a_sign_that_its_size_has_not(quick: Problem, rate: float) -> None:
    problem = aiming(quick, {"turning_rad_s": -1.0})
    found = walked(problem, 0.0, yaw=rate)
    assert found["turning_rad_s"] == pytest.approx(rate, rel=1e-6)
    evaluation = evaluate(problem, [found, found], ["ok", "ok"])
    assert evaluation.cost == pytest.approx(-rate, rel=1e-6)
    assert evaluation.metrics["yaw_rate_rad_s"] == pytest.approx(abs(rate), rel=1e-6)


def test_straightness_is_net_travel_over_the_path_from_cycle_to_cycle(quick: Problem) -> None:
    problem = aiming(quick, {"straightness": -1.0})
    assert walked(problem, 0.1)["straightness"] == pytest.approx(1.0)
    zigzag = walked(problem, 0.1, side=0.1)
    assert zigzag["straightness"] == pytest.approx(math.cos(math.pi / 4.0), rel=1e-6)
    assert walked(problem, 0.0)["straightness"] == 0.0


def test_a_wanted_speed_costs_its_error_and_its_power(quick: Problem) -> None:
    problem = aiming(quick, {"speed_error": 1.0, "cost_at_wanted_speed": 0.1}, wanted_speed_m_s=0.05)
    for speed, error in ((0.05, 0.0), (0.04, 0.2), (0.06, 0.2), (-0.05, 2.0)):
        found = walked(problem, speed, power=0.02)
        assert found["speed_error"] == pytest.approx(error, abs=1e-9)
        assert found["cost_at_wanted_speed"] == pytest.approx(0.02 / (2.0 * 0.05))
    exact = walked(aiming(quick, {"speed_error": 1.0}, wanted_speed_m_s=0.04), 0.04, power=0.02)
    assert "cost_at_wanted_speed" not in exact


def test_distance_per_charge_is_speed_times_how_long_the_battery_lasts(quick: Problem) -> None:
    battery = {"energy_wh": 2.0, "efficiency": 0.5, "idle_w": 0.4}
    problem = aiming(quick, {"distance_per_charge_m": -1.0}, battery=battery)
    found = walked(problem, 0.1, power=0.3)
    assert found["distance_per_charge_m"] == pytest.approx(0.1 * 7200.0 / (0.3 / 0.5 + 0.4))


@pytest.mark.parametrize(
    ("terms", "said"),
    [
        ({"speed_error": 1.0}, "objective.wanted_speed_m_s: missing; speed_error needs it"),
        ({"cost_at_wanted_speed": 1.0}, "objective.wanted_speed_m_s: missing"),
        ({"distance_per_charge_m": 1.0}, "objective.battery: missing; distance_per_charge_m needs it"),
        ({"turning_rad": 1.0}, "(nearest: 'turning_rad_s')"),
        ({"straightnes": 1.0}, "(nearest: 'straightness')"),
    ],
)
def test_one_line_says_what_is_missing(quick: Problem, terms: dict[str, float], said: str) -> None:
    with pytest.raises(GaitoptError) as caught:
        check_objective(aiming(quick, terms))
    assert said in str(caught.value)


@pytest.mark.slow
def test_aims_have_titles_and_a_search_takes_them(tmp_path: Path) -> None:
    assert label_of("straightness") == "straightness [%]"
    assert label_of("turning_rad_s") == "turning to the left [°/s]"

    def slow(content: dict[str, Any]) -> None:
        content["objective"] |= {"terms": {"speed_error": 1.0}, "wanted_speed_m_s": 0.03}

    folder = problem_folder(tmp_path / "bot", STRIDER, slow)
    words = ["optimise", str(folder), "--budget", "3", "--quiet", "--out", str(tmp_path / "run")]
    assert main(words) == 0
    assert "speed_error" in (tmp_path / "run" / "evaluations.csv").read_text().splitlines()[0]
