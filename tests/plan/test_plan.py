"""Plans: distinct gaits within bounds, faster than the baselines; dropped starts with a reason."""

import json

import pytest

from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.plan.gait_vector import gait_distance
from gaitopt.plan.plan import MISSES, Planner, PlanSettings
from gaitopt.problem.problem import Problem, load_problem


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem("arcfold")


@pytest.fixture(scope="module")
def planner(problem: Problem) -> Planner:
    return Planner(problem)


@pytest.mark.slow
def test_plan_beats_the_baselines_keeps_the_bounds_and_repeats_to_the_bit(problem: Problem) -> None:
    settings = PlanSettings(n_samples=8, n_starts=(5, 2, 1), n_elites=2)
    result, again = (Planner(problem, settings).plan() for _ in range(2))
    assert result == again
    assert result.elites[0].predicted_speed_m_s > max(result.baselines.values())
    vectors = [Planner(problem, settings).vector(elite.gait) for elite in result.elites]
    for i, (elite, vector) in enumerate(zip(result.elites, vectors, strict=True)):
        problem.check_gait(elite.gait, "elite")
        assert problem.space.decode(problem.space.encode(elite.gait)).period_s == elite.gait.period_s
        assert all(gait_distance(vector, other) > 0.9 * settings.separation for other in vectors[:i])


def test_baselines_come_in_the_order_that_mujoco_has(planner: Planner, problem: Problem) -> None:
    speeds = [
        planner.predicted_speed(problem.baselines[name]) for name in ("square-4s", "square-2s", "square-1s")
    ]
    assert 0.0 < speeds[0] < speeds[1] < speeds[2]


def test_a_plan_without_converged_starts_says_so(problem: Problem) -> None:
    settings = PlanSettings(n_samples=2, n_starts=(5, 1, 1), iterations=0, n_intervals=4)
    result = Planner(problem, settings).plan()
    assert result.dropped
    content = json.loads(to_json(result.to_dict()))
    assert list(content) == ["elites", "baselines", "dropped", "misses"]
    assert content["misses"] == MISSES
    assert [row["name"] for row in content["baselines"]] == list(problem.baselines)
    assert all("planned" in line and "integrated" in line for line in result.dropped)


def test_a_problem_without_a_planar_section_says_so_in_one_line() -> None:
    with pytest.raises(GaitoptError, match=r"no \[planar\] section"):
        Planner(load_problem("arcfold-published"))
