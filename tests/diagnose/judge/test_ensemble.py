"""What recordings tell of small errors, and so of the speed in another gait."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from toyfits import toy_trials

from gaitopt.core.streams import seeded
from gaitopt.diagnose.judge.ensemble import FEWEST, Ensemble
from gaitopt.diagnose.judge.perturbed import PerturbedRobots

ERRORS, ROWS = 6, 40
RNG = seeded(5)
RESPONSES = 3.0 * RNG.standard_normal((ERRORS, ROWS))
WORTH = RNG.standard_normal(ERRORS)
"""What each error does to the recordings, in standard errors, and to the speed."""


class DoublingTrial:
    """A trial of white rows, by a covariance that is four times that of its measurement."""

    n_rows = 4

    def whitening_update(self, changes: np.ndarray) -> np.ndarray:
        return np.diag([0.5, 0.4, 0.3, 0.2])

    def in_measurement_errors(self, rows: np.ndarray) -> np.ndarray:
        return 2.0 * rows


def test_recordings_and_robots_are_compared_in_errors_of_the_measurement() -> None:
    """What is left is the mean over explanations; a trial that none of them fits counts less."""
    changes = seeded(4).standard_normal((3, 8))
    trial_set = toy_trials(8, 4, (DoublingTrial(), DoublingTrial()), trials=2).with_covariance_of(changes)  # type: ignore[arg-type]
    left = {"trim": np.repeat([1.0, 40.0], 4), "none": np.repeat([3.0, 80.0], 4)}
    white = {name: trial_set.rewhiten_rows(rows, trial_set.initial) for name, rows in left.items()}
    judgement: Any = SimpleNamespace(
        trial_set=trial_set,
        tolerant_robots=PerturbedRobots((), changes, (0, 2, 5)),
        ranking=SimpleNamespace(candidates=[SimpleNamespace(whitened=white["trim"])]),
        none=SimpleNamespace(whitened=white["none"]),
        chances=np.array([0.75, 0.25]),
    )
    found = Ensemble.of(judgement)
    assert found is not None
    mixed = 0.75 * left["trim"] + 0.25 * left["none"]
    odd = np.mean((50.0 * np.array([0.5, 0.4, 0.3, 0.2])) ** 2)
    scale = np.sqrt(10.0 * np.repeat([1.0, odd], 4))
    assert found.left == pytest.approx(2.0 * mixed / scale)
    assert found.changes == pytest.approx(2.0 * changes / scale)
    assert found.numbers == (0, 2, 5)
    judgement.tolerant_robots = None
    assert Ensemble.of(judgement) is None


def walked(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """What some robots do to the recordings, and their speeds."""
    errors = seeded(seed).standard_normal((count, ERRORS))
    return errors @ RESPONSES, 10.0 + errors @ WORTH


def expected(changes: np.ndarray, values: np.ndarray, seed: int) -> list[tuple[float, float, float]]:
    """What is expected of other robots whose recordings are known: mean, half an interval, truth."""
    (others, speeds), rng = walked(40, seed), seeded(seed + 100)
    found = []
    for own, speed in zip(others, speeds, strict=True):
        left = own + rng.standard_normal(ROWS)
        learnt = Ensemble(changes, -left, tuple(range(len(values)))).learnt(values, 1)
        assert learnt is not None
        found.append((learnt.mean, learnt.ci90[1] - learnt.mean, speed))
    return found


def test_robots_like_the_recorded_one_tell_its_speed() -> None:
    changes, values = walked(48, 1)
    rows = np.array(expected(changes, values, 2))
    errors = rows[:, 0] - rows[:, 2]
    assert np.std(errors) < 0.2 * np.std(rows[:, 2])
    assert np.mean(rows[:, 1]) < 0.3 * 1.7 * np.std(values)
    assert 0.75 <= np.mean(np.abs(errors) <= rows[:, 1]) <= 1.0


def test_nothing_is_learnt_of_a_speed_that_the_recordings_do_not_show() -> None:
    changes, _ = walked(48, 1)
    values = 10.0 + seeded(9).standard_normal(48)
    rows = np.array(expected(changes, values, 2))
    assert np.abs(rows[:, 0] - values.mean()).max() < 1.0
    assert rows[0, 1] == pytest.approx(1.68 * np.std(values), rel=0.15)


def test_robots_that_change_nothing_leave_what_was_expected_before() -> None:
    values = seeded(9).standard_normal(48)
    learnt = Ensemble(np.zeros((48, ROWS)), np.ones(ROWS), tuple(range(48))).learnt(values, 1)
    assert learnt is not None
    assert learnt.mean == pytest.approx(values.mean())


def test_a_robot_that_failed_is_left_out_and_a_few_tell_nothing() -> None:
    changes, values = walked(48, 1)
    failed = np.where(np.arange(48) < 10, np.nan, values)
    every, without = (
        Ensemble(changes, np.zeros(ROWS), tuple(range(48))).learnt(v, 1) for v in (values, failed)
    )
    assert every is not None
    assert without is not None
    assert without != every
    assert without.mean == pytest.approx(every.mean, abs=0.1)
    few = np.where(np.arange(48) < FEWEST - 1, values, np.nan)
    assert Ensemble(changes, np.zeros(ROWS), tuple(range(48))).learnt(few, 1) is None
