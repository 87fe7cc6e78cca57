"""A set of trials whitened by one covariance after another, and its simulations in the cache."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planting import SIGNALS, dataset, recording_of, rollout

from gaitopt.diagnose.diagnosis import locate
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.heads import head_of
from gaitopt.diagnose.fit.runner import RobotRequest, Runner
from gaitopt.diagnose.fit.settings import FIT
from gaitopt.diagnose.gap.predict import latest_gait_time
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.find_causes import NominalGap, PreparedTrials, prepare_trials
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

SLOPE = {"ground_slope": {"angle_rad": 0.05}}


@pytest.fixture(scope="module")
def folder(arcfold: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trial of the nominal robot."""
    trial = {"walk": ("square-1s", recording_of(rollout(arcfold, "square-1s", 4.0)))}
    return dataset(tmp_path_factory.mktemp("data"), trial, starts_at_gait_time_s=0.0)


@pytest.fixture(scope="module")
def prepared(arcfold: Problem, folder: Path) -> PreparedTrials:
    """The trial, ready to be compared, beside the nominal robot and seven perturbed ones."""
    simulator = Simulator.build(arcfold)
    data = load_dataset(folder, arcfold, list(SIGNALS))
    with open_executor("threads", 2) as executor:
        found = locate(simulator, data, executor, 1).trials
        trials, floors = [one.aligned for one in found], [one.floors for one in found]
        gap = NominalGap(simulator, trials, floors, 0.0)
        return prepare_trials(gap, Context(Runner(executor), 1))


@pytest.fixture(scope="module")
def changes(prepared: PreparedTrials) -> np.ndarray:
    """What the perturbed robots change."""
    known = [one for one in prepared.perturbed if one is not None]
    assert len(known) == len(prepared.perturbed)
    return np.array([one.whitened - prepared.nominal.whitened for one in known])


def test_the_same_robots_give_the_same_covariance(prepared: PreparedTrials, changes: np.ndarray) -> None:
    ready, nominal = prepared.trial_set, prepared.nominal
    again = ready.with_covariance_of(changes).rewhiten(nominal, ready)
    assert again.whitened == pytest.approx(nominal.whitened, abs=1e-6)


def test_what_robots_differ_by_counts_less_and_all_else_does_not_count_more(
    prepared: PreparedTrials, changes: np.ndarray
) -> None:
    ready, nominal = prepared.trial_set, prepared.nominal
    wild = ready.with_covariance_of(8.0 * changes)
    rows = (changes.T, wild.rewhiten_rows(changes.T, ready))
    before, after = (np.linalg.norm(columns, axis=0) for columns in rows)
    assert np.all(after < 0.5 * before)
    assert np.linalg.norm(wild.rewhiten(nominal, ready).whitened) <= np.linalg.norm(nominal.whitened)


def test_comparisons_and_columns_come_back_unchanged(prepared: PreparedTrials, changes: np.ndarray) -> None:
    ready, nominal = prepared.trial_set, prepared.nominal
    wild, wilder = ready.with_covariance_of(3.0 * changes), ready.with_covariance_of(9.0 * changes)
    there = wilder.rewhiten(wild.rewhiten(nominal, ready), wild)
    assert there.whitened == pytest.approx(wilder.rewhiten(nominal, ready).whitened)
    assert ready.rewhiten(there, wilder).whitened == pytest.approx(nominal.whitened)
    columns = wild.rewhiten_rows(changes.T, ready)
    assert columns[:, 2] == pytest.approx(wild.rewhiten_rows(changes[2], ready))
    assert wild.initial.updates == ()


def test_the_cache_knows_a_robot_by_any_covariance(
    prepared: PreparedTrials, changes: np.ndarray, tmp_path: Path
) -> None:
    """Earlier simulations are used again, whitened by the re-estimated covariance."""
    ready = prepared.trial_set
    cache = SimulationCache(tmp_path / "cache")
    runner, request = Runner(SerialExecutor(), cache=cache), RobotRequest(SLOPE, (0.05,))
    (first,) = runner.compare(ready, [request])
    assert cache.count == 1
    wild = ready.with_covariance_of(4.0 * changes)
    (recalled,) = replace(runner, executor=NoExecutor()).compare(wild, [request])
    assert first is not None
    assert recalled is not None
    assert np.array_equal(recalled.whitened, wild.rewhiten(first, ready).whitened)
    assert np.array_equal(recalled.marker, first.marker)


class NoExecutor(SerialExecutor):
    """Simulates nothing."""

    def submit(self, *_: object, **__: object) -> None:  # type: ignore[override]
        raise AssertionError("nothing needs to be simulated")


def test_the_averaging_matrix_gives_the_means_of_each_signal(prepared: PreparedTrials) -> None:
    (one,) = prepared.trial_set.trials
    predicted, offset = one.aligned.simulated, one.aligned.offset_s
    parts = [one.bins.averaging(name, predicted.time, offset) @ predicted[name] for name in one.bins.rows]
    np.testing.assert_allclose(np.sum(parts, axis=0), one.bins.means(predicted, offset), atol=1e-12)


HEAD_S = 1.5


def test_the_beginning_of_a_trial_is_whitened_as_in_the_whole_trial(
    prepared: PreparedTrials, changes: np.ndarray
) -> None:
    """Rows are in order of time, and each is whitened by those before it alone."""
    whole = prepared.trial_set.with_covariance_of(4.0 * changes)
    head = whole.head(HEAD_S)
    request = RobotRequest(SLOPE, (0.05,))
    runner = Runner(SerialExecutor())
    (all_rows,), (first_rows,) = runner.compare(whole, [request]), runner.compare(head, [request])
    assert all_rows is not None
    assert first_rows is not None
    count = len(first_rows.whitened)
    assert count == pytest.approx(len(all_rows.whitened) * HEAD_S / 4.0, rel=0.1)
    np.testing.assert_allclose(first_rows.whitened, all_rows.whitened[:count], atol=1e-8)
    (run,) = head.runs.values()
    assert run.duration_s == pytest.approx(HEAD_S, abs=0.1)


def test_the_beginning_is_a_block_at_least(prepared: PreparedTrials) -> None:
    head = prepared.trial_set.head(0.2)
    assert head.n_blocks == 1
    assert head.trials[0].aligned.trial.time[-1] == pytest.approx(1.0, abs=0.1)


def test_beginnings_are_taken_where_they_show_the_gap_and_save_time(prepared: PreparedTrials) -> None:
    ready = prepared.trial_set
    short = replace(FIT, head_s=1.5, shown=-math.inf, visible=0.0)
    head = head_of(ready, short)
    assert head is not None
    assert head.clear
    assert len(head.nominal.whitened) == len(head.trial_set.row_blocks) < len(ready.row_blocks)
    faint = head_of(ready, replace(short, visible=50.0))
    assert faint is not None
    assert not faint.clear
    assert head_of(ready, replace(short, shown=0.0)) is None  # the recording is the nominal robot's
    assert head_of(ready, replace(short, head_s=3.5)) is None


def test_no_more_is_simulated_than_an_unknown_start_can_need(prepared: PreparedTrials) -> None:
    """The fit of an offset goes only some steps, so the end of a longer rollout would never be read."""
    ready = prepared.trial_set
    (one,) = ready.trials
    unknown = replace(one, aligned=replace(one.aligned, trial=replace(one.aligned.trial, starts_at_s=None)))
    some = replace(ready, trials=(unknown,))
    (run,) = some.runs.values()
    assert run.duration_s < latest_gait_time(unknown.aligned.trial)
    simulator = Simulator.build(ready.problem.with_effects(SLOPE))
    longer, shorter = (
        simulator.observe(simulator.run(run.drive, 0, seconds))
        for seconds in (latest_gait_time(unknown.aligned.trial), run.duration_s)
    )
    both = [some.compare([0.05], [path]) for path in (longer, shorter)]
    assert both[0] is not None
    assert both[1] is not None
    np.testing.assert_array_equal(both[0].whitened, both[1].whitened)
