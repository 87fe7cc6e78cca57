"""The study: every method spends its budget, and the best gait is verified."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from searching import run

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import Progress
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Evaluated, Evaluator, Outcome
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.recorder import SearchProgress
from gaitopt.optimise.run import Request
from gaitopt.optimise.stages import method_names, method_of
from gaitopt.optimise.study import Start, Study
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.runs.summary import Summary
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.objective import Evaluation
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup


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


@dataclass(frozen=True)
class Still(Evaluator):
    """Finds every gait equally bad."""

    def __call__(self, gaits: Sequence[Gait]) -> list[Evaluated]:
        metrics = dict.fromkeys(metric_names(self.setup.problem), 0.0)
        kept = dict.fromkeys(self.setup.problem.objective.constraints, 0.0)
        return [Evaluated(Evaluation(1.0, metrics, kept, "ok"), [Outcome({}, "ok", 2.0)]) for _ in gaits]


@pytest.mark.parametrize(("method", "near"), [("cma-es", "fast"), ("nelder-mead", "slow")])
def test_only_a_search_with_small_penalties_starts_at_a_fast_gait_that_breaks_a_limit(
    strider: Problem, tmp_path: Path, method: str, near: str
) -> None:
    """With the full penalty the fast gait is worse than the slow one; with a fifth of it, it is better."""
    objective, space = strider.objective, strider.space
    points = {"slow": np.full(len(space.variables), 0.3), "fast": np.full(len(space.variables), 0.7)}
    kept = dict.fromkeys(objective.constraints, 0.0)
    broken = kept | {"tilt_rad": 1.0}
    starts = [
        Start(space.decode(points["slow"]), Evaluation(-0.04, {}, kept, "ok")),
        Start(space.decode(points["fast"]), Evaluation(-0.07 + objective.penalty, {}, broken, "ok")),
    ]
    setup = RobotSetup.of(strider, (NOMINAL,), strider.simulation.working)
    study = Study(Still(setup, SerialExecutor()), Journal(tmp_path / "evaluations.csv", strider), 10, 1)
    study.run(method_of(method), starts)
    middle = np.mean([entry.point[0] for entry in study.entries])
    assert min(points, key=lambda name: abs(points[name][0] - middle)) == near
