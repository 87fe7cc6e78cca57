"""The covariance that the robots in question teach: what it overlooks, and whom it lets win."""

from concurrent.futures import Executor
from types import SimpleNamespace

import numpy as np
import pytest
from planting import SIGNALS, dataset, filmed, rollout
from toyfits import toy_bench, toy_fit, toy_point

from gaitopt.diagnose.diagnosis import locate
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.fitting import simulate
from gaitopt.diagnose.judge import covariance as looking
from gaitopt.diagnose.judge import evidence
from gaitopt.diagnose.judge.causes import _one_falls_short, prepared
from gaitopt.diagnose.judge.covariance import Judgement
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.optimise.executors import open_executor
from gaitopt.simulation.rollout import Simulator

ROWS = 60


@pytest.fixture(scope="module")
def robots(arcfold, tmp_path_factory):
    """A trial of the nominal robot, ready to be compared, beside it and beside seven drawn ones."""
    folder = tmp_path_factory.mktemp("look")
    trial = {"walk": ("square-1s", filmed(rollout(arcfold, "square-1s", 4.0)))}
    data = load_dataset(dataset(folder / "data", trial, starts_at_gait_time_s=0.0), arcfold, list(SIGNALS))
    simulator = Simulator.build(arcfold)
    with open_executor("threads", 2) as executor:
        found = locate(simulator, data, executor, 1).trials
        trials, floors = [one.aligned for one in found], [one.floors for one in found]
        cache = SimulationCache.of(folder / "cache", simulator, data, 1)
        ready, nominal, about = prepared(simulator, trials, floors, executor, 1, cache)
    return ready, nominal, np.array([point.whitened - nominal.whitened for point in about])


def test_the_same_robots_teach_the_same(robots):
    ready, nominal, changes = robots
    again = ready.with_covariance_of(changes).rewhiten_comparison(nominal, ready)
    assert again.whitened == pytest.approx(nominal.whitened, abs=1e-6)


def test_what_robots_differ_by_counts_less_and_all_else_does_not_count_more(robots):
    ready, nominal, changes = robots
    wild = ready.with_covariance_of(8.0 * changes)
    before, after = (np.linalg.norm(rows, axis=0) for rows in (changes.T, wild.rewhiten(changes.T, ready)))
    assert np.all(after < 0.5 * before)
    assert np.linalg.norm(wild.rewhiten_comparison(nominal, ready).whitened) <= np.linalg.norm(
        nominal.whitened
    )


def test_points_and_columns_come_back_unchanged(robots):
    ready, nominal, changes = robots
    wild, wilder = ready.with_covariance_of(3.0 * changes), ready.with_covariance_of(9.0 * changes)
    there = wilder.rewhiten_comparison(wild.rewhiten_comparison(nominal, ready), wild)
    assert there.whitened == pytest.approx(wilder.rewhiten_comparison(nominal, ready).whitened)
    assert ready.rewhiten_comparison(there, wilder).whitened == pytest.approx(nominal.whitened)
    columns = wild.rewhiten(changes.T, ready)
    assert columns[:, 2] == pytest.approx(wild.rewhiten(changes[2], ready))
    assert wild.first.whitening_updates == ()


def test_memory_knows_a_robot_by_any_covariance(robots):
    """What was simulated before it was taught anew is recalled as it looks since."""
    ready, _, changes = robots
    effects, wild = {"ground_slope": {"angle_rad": 0.05}}, ready.with_covariance_of(4.0 * changes)
    first = simulate(ready, effects, [0.05], False)
    assert ready.cache.count > 0
    recalled = simulate(wild, effects, [0.05], False)
    assert np.array_equal(recalled.whitened, wild.rewhiten_comparison(first, ready).whitened)
    assert np.array_equal(recalled.marker, first.marker)


class Trial:
    """A trial of white rows: robots teach what they differ by, and nothing else."""

    counts = np.ones(ROWS)

    def whitening_update(self, changes):
        return np.linalg.inv(np.linalg.cholesky(np.eye(ROWS) + changes.T @ changes / len(changes)))


def test_a_rival_that_imitates_what_nobody_knows_does_not_win(monkeypatch):
    """The cause is ruled out by its twin until robots are drawn that show what nobody knows of them."""
    rng = np.random.default_rng(3)
    cause, unknown = 6.0 * rng.standard_normal(ROWS), 8.0 * rng.standard_normal(ROWS)
    measured = cause + 0.8 * unknown + rng.standard_normal(ROWS)
    trials = toy_bench(ROWS, 6, (Trial(),), SimpleNamespace(channel_names=("one", "two")))
    nominal, at = toy_point([0.0], measured), (0.0, 0.5, 1.0)
    changes = {"cause": cause, "twin": cause + unknown, "idle": rng.standard_normal(ROWS)}
    fits = tuple(
        toy_fit(trials, measured, lambda a, change=change: a * change, at, name)
        for name, change in changes.items()
    )
    drawn = []

    def about(trial_set, candidate, executor, seed):
        drawn.append(candidate.label)
        return SimpleNamespace(changes=np.outer(rng.standard_normal(8), unknown))

    monkeypatch.setattr(looking.precision, "perturbed_about", about)
    monkeypatch.setattr(looking, "finish", lambda *said: None)
    look = Judgement(trials, nominal, fits)
    assert named(look) == {"twin"}
    refine_covariance = look.refine_covariance(Executor(), 1, lambda *said: None)
    assert named(refine_covariance) == {"twin", "cause"}
    assert drawn[0] == "twin"
    assert "cause" in drawn
    assert "idle" not in drawn


def named(look):
    order, chances = look.ranked
    return set(evidence.answer_set(evidence.by_effect(order, chances)))


@pytest.mark.parametrize(("does", "short"), [(0.6, False), (1.0, True), (1.3, True)])
def test_two_effects_are_tried_where_the_best_would_go_on_beyond_its_range(does, short):
    """Even if it leaves no more there than a right one does."""
    trial_set, rng = toy_bench(ROWS, 6, trials=2), np.random.default_rng(5)
    direction, noise = rng.standard_normal((2, ROWS))
    measured = does * direction + 0.5 * noise
    fit = toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.3, 0.6, 1.0))
    look = Judgement(trial_set, toy_point([], measured), (fit,))
    (best,) = look.singles
    assert evidence.left(trial_set, best) < 1.2
    assert _one_falls_short(look) == short


def test_two_effects_are_tried_where_the_best_leaves_more_than_a_right_one():
    trial_set, rng = toy_bench(ROWS, 6, trials=2), np.random.default_rng(5)
    direction, noise = rng.standard_normal((2, ROWS))
    measured = 0.5 * direction + 1.5 * noise
    fit = toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.3, 0.6, 1.0))
    assert not fit.hypothesis.at_bound(fit.best())
    assert _one_falls_short(Judgement(trial_set, toy_point([], measured), (fit,)))
