"""Gaits of robots that are a little wrong in everything: the covariance and the floors."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from toyfits import toy_comparison, toy_trials

from gaitopt import Problem
from gaitopt.core.streams import seeded
from gaitopt.diagnose.fit.robust import WideLoss
from gaitopt.diagnose.gap.floor import Floor
from gaitopt.diagnose.judge.apart import floors_apart, squares_apart
from gaitopt.diagnose.judge.gait_sets import GaitSets
from gaitopt.diagnose.judge.perturbed import compared_about
from gaitopt.diagnose.judge.settings import DEFAULT
from gaitopt.diagnose.judge.small_errors import tolerant_robots, tolerant_scenarios
from gaitopt.simulation.rollout import Simulator


def wide_loss(trials: int = 3, each: int = 30) -> WideLoss:
    return WideLoss(np.repeat(np.arange(trials), each), 4.0, 3.0, 10.0, np.ones(trials), np.ones(trials))


def test_the_weights_of_a_wide_covariance_are_the_slope_of_its_loss() -> None:
    loss = wide_loss()
    white = seeded(1).standard_normal(90) * np.repeat([0.5, 3.0, 30.0], 30)
    weights = loss.trial_weights(loss.squares(white))[loss.row_trials]
    for row in (0, 35, 80):
        aside = white.copy()
        aside[row] += 1e-5
        slope = (loss.total(aside) - loss.total(white)) / 1e-5
        assert slope == pytest.approx(2.0 * weights[row] * white[row], rel=1e-3)


def test_a_trial_that_fits_better_than_the_covariance_says_counts_no_more_than_the_others() -> None:
    loss = wide_loss()
    weights = loss.trial_weights(loss.squares(np.repeat([0.1, 1.0, 30.0], 30)))
    assert weights[0] == pytest.approx(weights[1])
    assert weights[2] < 0.01 * weights[1]


def test_robots_are_wrong_in_everything_and_the_same_for_the_same_seed(strider: Problem) -> None:
    simulator = Simulator.build(strider)
    robots, again, other = (tolerant_robots(simulator, seed, 4) for seed in (1, 1, 2))
    masses = [tuple(robot.models[0].body_mass) for robot in robots]
    assert masses == [tuple(robot.models[0].body_mass) for robot in again]
    assert len({*masses, *(tuple(robot.models[0].body_mass) for robot in other)}) == 8
    assert all(robot.scenarios[0].errors.friction for robot in robots)
    assert all("camera_scale" in [one.effect.name for one in robot.effects.active] for robot in robots)
    steps = [robot.fidelity.timestep_s for robot in robots]
    assert steps[1] == pytest.approx(0.5 * steps[0])


def test_the_scenarios_of_such_robots_are_those_that_they_walk_in(strider: Problem) -> None:
    simulator = Simulator.build(strider)
    loaded = Simulator.build(strider.with_effects({"servo_gain": {"scale": 0.8}}))
    robots = tolerant_robots(loaded, 3, 5)
    assert tolerant_scenarios(simulator, 3, 5) == [robot.scenarios[0] for robot in robots]


def test_robots_that_fail_are_left_out_by_their_number(strider: Problem) -> None:
    simulator = Simulator.build(strider)
    found = [toy_comparison([], np.full(4, size)) for size in (1.0, 2.0, 4.0)]
    runner: Any = SimpleNamespace(compare_robots=lambda trial_set, robots: [found[0], None, *found[1:]])
    trial_set: Any = SimpleNamespace(problem=strider, simulator=simulator, row_blocks=np.zeros(4))
    robots = compared_about(
        trial_set, {}, "drawn", lambda centre: [centre] * 3, SimpleNamespace(runner=runner)
    )  # type: ignore[arg-type]
    assert robots.numbers == (1, 2)
    assert robots.changes[:, 0] == pytest.approx([1.0, 3.0])


def test_how_far_robots_are_apart_is_counted_in_floors_of_the_worst_trial() -> None:
    trial_set: Any = SimpleNamespace(
        block_trials=np.array([0, 1]),
        sample_blocks=np.array([0, 0, 1, 1]),
        angle_blocks=np.array([0, 0, 1, 1]),
    )
    floors = [
        {"marker.x": Floor(1e-3, None, 0.0, 0.0), "joint.mid": Floor(2e-3, None, 0.0, 0.0)} for _ in range(2)
    ]
    one, other = toy_comparison([], np.zeros(2)), toy_comparison([], np.zeros(2))
    one = replace(one, marker=np.zeros(4), angles=np.zeros(4))
    moved = replace(other, marker=np.array([1e-3, -1e-3, 4e-3, -4e-3]), angles=np.zeros(4))
    assert floors_apart(trial_set, one, moved, floors) == pytest.approx(4.0)
    turned = replace(other, marker=np.zeros(4), angles=np.array([0.012, 0.012, 0.0, 0.0]))
    assert floors_apart(trial_set, one, turned, floors) == pytest.approx(2.0)


def test_how_far_exact_robots_are_apart_is_counted_in_whitened_squares_of_the_worst_trial() -> None:
    trial_set = toy_trials(8, 4, trials=2)
    one = toy_comparison([], np.zeros(8))
    moved = toy_comparison([], np.repeat([0.1, 3.0], 4))
    assert squares_apart(trial_set, one, moved) == pytest.approx(9.0)


@pytest.mark.parametrize(("rows", "fitted"), [(10, 16), (40, DEFAULT.gait_sets.begun)])
def test_the_tolerant_search_sets_out_from_the_sums_by_its_own_covariance(
    monkeypatch: pytest.MonkeyPatch, rows: int, fitted: int
) -> None:
    """All sums are fitted to beginnings; whole trials are fitted the usual number of sets."""
    module = import_module("gaitopt.diagnose.judge.gait_sets")
    tolerant, wide = (
        SimpleNamespace(fits="tolerant fits", nominal="tolerant nominal"),
        SimpleNamespace(n_rows=40),
    )
    first: Any = SimpleNamespace(n_rows=rows)
    sums: Any = {("tolerant fits", "tolerant nominal"): [["a pair"]] * 16}
    monkeypatch.setattr(module, "with_tolerances", lambda *_: tolerant)
    monkeypatch.setattr(module, "best_sums", lambda fits, nominal: sums[fits, nominal])
    told: dict[str, Any] = {}

    def run(self: GaitSets, judgement: Any, hypotheses: Any, settings: Any, known: Any, begin: Any) -> Any:
        told["begin"], told["fitted"] = begin, settings.begun
        return "judge", "fits"

    monkeypatch.setattr(GaitSets, "_run", run)
    monkeypatch.setattr(GaitSets, "_end", lambda self, first, judge, fits, settings, *_: settings)
    context: Any = SimpleNamespace(settings=DEFAULT)
    ended: Any = GaitSets(first, wide, (), (), context).with_tolerances()  # type: ignore[arg-type]
    assert (told["begin"], told["fitted"]) == ([["a pair"]] * 16, fitted)
    assert ended == DEFAULT.gait_sets


@pytest.mark.parametrize(("rows", "tolerant", "begin"), [(10, True, 5), (10, False, 4), (40, True, 4)])
def test_whole_trials_of_a_robot_that_is_a_little_wrong_are_searched_from_their_own_sums_too(
    monkeypatch: pytest.MonkeyPatch, rows: int, tolerant: bool, begin: int
) -> None:
    """Beginnings hardly tell some sets apart, so the best of them may be a wrong one."""
    module = import_module("gaitopt.diagnose.judge.gait_sets")
    judgement: Any = SimpleNamespace(n_rows=rows, fits=[], nominal=None, tolerant=tolerant)
    monkeypatch.setattr(module, "_with_fits_of", lambda *_: judgement)
    monkeypatch.setattr(module, "_beginnings", lambda *_: [["found"]] * 4)
    monkeypatch.setattr(module, "best_sums", lambda *_: [["a sum"]])
    monkeypatch.setattr(module, "_judged", lambda *_: "judged")
    monkeypatch.setattr(GaitSets, "_averaged", lambda *_: None)
    monkeypatch.setattr(module, "replace", lambda one, **_: one)
    told: list[Any] = []

    def run(self: GaitSets, judgement: Any, hypotheses: Any, settings: Any, known: Any, begin: Any) -> Any:
        told.append(begin)
        return "judge", "fits"

    monkeypatch.setattr(GaitSets, "_run", run)
    fits: Any = [SimpleNamespace(hypotheses=("an effect",), point="point")]
    sets = GaitSets(judgement, SimpleNamespace(n_rows=40), (), (), None)  # type: ignore[arg-type]
    sets._end(judgement, "judge", fits, DEFAULT.gait_sets, lambda one, *_: one, None)  # type: ignore[arg-type]
    assert len(told[0]) == begin
    assert (["a sum"] in told[0]) == (begin == 5)
