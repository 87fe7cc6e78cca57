"""The study: every method spends its budget, and the best gait is verified."""

from pathlib import Path

import pytest
from searching import run

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import Progress
from gaitopt.core.streams import Stream
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.recorder import SearchProgress
from gaitopt.optimise.run import Request
from gaitopt.optimise.stages import method_names
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.runs.summary import Summary


@pytest.mark.parametrize("method", method_names())
@pytest.mark.parametrize("budget", [1, 2, 5, 13])
def test_every_method_spends_at_most_its_budget(
    strider: Problem, tmp_path: Path, method: str, budget: int
) -> None:
    steps: list[Progress] = []
    path = tmp_path / "evaluations.csv"
    optimised = run(strider, path, Request(1, budget, method), progress=steps)
    progress = [step for step in steps if isinstance(step, SearchProgress)]
    assert len(optimised.entries) == budget
    if method != "default":
        assert {entry.method for entry in optimised.entries} == {method}
    assert progress[-1].done == progress[-1].total == budget
    bests = [p.best.evaluation.cost for p in progress if p.best is not None]
    assert bests == sorted(bests, reverse=True)
    assert optimised.found_by in {*method_names(), "quasi-random", *strider.baselines}


@pytest.mark.slow
def test_the_search_beats_its_first_batch(strider: Problem, tmp_path: Path) -> None:
    optimised = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=150))
    first = [e.evaluation.cost for e in optimised.entries if e.method == "quasi-random"]
    assert min(entry.evaluation.cost for entry in optimised.entries) < min(first)
    assert optimised.best.speed > max(baseline.speed for baseline in optimised.baselines)


def test_the_winner_is_a_gait_of_the_search_or_the_best_baseline(strider: Problem, tmp_path: Path) -> None:
    """With a budget of one gait there are two finalists, and the winner is named after its finder."""
    optimised = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=1))
    (entry,) = optimised.entries
    expected = strider.baselines.get(optimised.found_by, entry.gait)
    assert (optimised.best.gait.period_s, optimised.best.gait.channels) == (
        expected.period_s,
        expected.channels,
    )
    assert optimised.found_by in {entry.method, *strider.baselines}


def test_the_winner_is_verified_on_scenarios_never_searched(strider: Problem, tmp_path: Path) -> None:
    optimised = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=4))
    assert scenarios_of(strider, 1, Stream.VERIFICATION_SCENARIOS)[-1].framed
    for verified in [optimised.best, *optimised.baselines]:
        assert verified.speeds.shape == (strider.file.scenarios.verification,)
        low, high = verified.speed_ci90
        assert low < verified.speed < high
        assert verified.worst <= verified.speed
    assert [verified.gait.name for verified in optimised.baselines] == list(strider.baselines)


def test_a_robot_without_baselines_is_searched(strider: Problem, tmp_path: Path) -> None:
    file = strider.file.model_copy(update={"baselines": {}})
    problem = Problem.from_file(file, strider.source, strider.model_path)
    optimised = run(problem, tmp_path / "evaluations.csv", Request(seed=1, budget=6))
    content = Summary.of(problem, optimised)
    assert content.baselines == ()
    assert content.ratio_to_best_baseline is None


def test_a_robot_that_always_fails_says_so(strider: Problem, tmp_path: Path) -> None:
    exploding = strider.with_parameters({"k_servo": 1e7, "torque_limit": 1e12})
    path = tmp_path / "evaluations.csv"
    with pytest.raises(GaitoptError) as error:
        run(exploding, path, Request(seed=1, budget=5))
    assert str(error.value) == "every one of 5 gaits failed in simulation: diverged: badqacc (5)"
    assert len(Journal(path, exploding).entries) == 5


def test_an_unknown_method_is_one_line(strider: Problem, tmp_path: Path) -> None:
    with pytest.raises(GaitoptError) as error:
        run(strider, tmp_path / "evaluations.csv", Request(method="cma"))
    assert str(error.value) == (
        "--method: found 'cma'; allowed: default, cma-es, nelder-mead (nearest: 'cma-es')"
    )
