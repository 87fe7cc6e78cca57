"""Intervals of the mean, and standard deviations that odd values do not change."""

import math

import numpy as np
import pytest
from scipy import stats

from gaitopt.core.statistics import (
    NORMAL_95,
    explained_by_groups,
    half_width90,
    interval90,
    noise_sd,
    robust_sd,
    spread90,
    uniform_sd,
)


def test_the_interval_is_scipys() -> None:
    values = np.random.default_rng(1).normal(3.0, 2.0, 9)
    error = stats.sem(values)
    expected = stats.t.interval(0.9, len(values) - 1, loc=values.mean(), scale=error)
    assert interval90(values) == pytest.approx(expected, rel=1e-12)
    assert half_width90(values) == pytest.approx((expected[1] - expected[0]) / 2.0, rel=1e-12)


def test_one_value_is_both_ends() -> None:
    assert interval90(np.array([2.5])) == (2.5, 2.5)


def test_nine_in_ten_intervals_hold_the_mean() -> None:
    rng = np.random.default_rng(2)
    ends = np.array([interval90(rng.normal(0.0, 1.0, 5)) for _ in range(2000)])
    assert np.mean((ends[:, 0] < 0.0) & (ends[:, 1] > 0.0)) == pytest.approx(0.9, abs=0.02)


@pytest.mark.parametrize("count", [19, 48, 128])
def test_nine_in_ten_intervals_of_values_hold_one_more(count: int) -> None:
    """Of a skewed distribution, too."""
    rng = np.random.default_rng(count)
    drawn = rng.exponential(1.0, (4000, count + 1))
    ends = np.array([spread90(row[1:]) for row in drawn])
    held = (ends[:, 0] <= drawn[:, 0]) & (drawn[:, 0] <= ends[:, 1])
    assert np.mean(held) == pytest.approx(0.9, abs=0.015)


def test_few_values_lie_between_the_ends_of_their_interval() -> None:
    assert spread90(np.array([3.0, np.nan, 1.0, 2.0])) == (1.0, 3.0)
    assert np.isnan(spread90(np.array([np.nan]))).all()


def test_the_normal_distributions_point() -> None:
    assert stats.norm.ppf(0.95) == pytest.approx(NORMAL_95, abs=2e-4)


def test_the_interval_is_students() -> None:
    """Of 1, 2, 3: mean 2, standard error 1/sqrt(3), t(0.95, 2) = 2.920."""
    low, high = interval90(np.array([1.0, 2.0, 3.0]))
    half = 2.919986 / math.sqrt(3.0)
    assert (low, high) == pytest.approx((2.0 - half, 2.0 + half), rel=1e-6)
    assert interval90(np.array([2.0])) == (2.0, 2.0)


def test_some_odd_values_do_not_change_a_robust_standard_deviation() -> None:
    values = np.random.default_rng(3).normal(0.0, 2.0, 4000)
    values[::50], values[1::50] = 1e6, np.nan
    assert robust_sd(values) == pytest.approx(2.0, rel=0.1)
    assert math.isnan(robust_sd(np.array([np.nan])))


@pytest.mark.parametrize("order", [2, 3])
def test_the_noise_of_a_series_is_found_beside_its_motion_and_gaps(order: int) -> None:
    time = np.arange(4000) / 30.0
    series = np.sin(time) + np.random.default_rng(4).normal(0.0, 0.01, len(time))
    series[100:200] = np.nan
    assert noise_sd(series, order) == pytest.approx(0.01, rel=0.1)
    assert math.isnan(noise_sd(series[:order], order))


def test_what_a_value_explains_may_have_any_shape_and_chance_explains_nothing() -> None:
    random = np.random.default_rng(2)
    values, noise = random.random(4000), random.normal(size=4000)
    bent = (values - 0.5) ** 2  # no correlation
    assert explained_by_groups(values, bent / bent.std(), 8) > 0.9
    assert explained_by_groups(values, bent / bent.std() + noise, 8) == pytest.approx(0.48, abs=0.05)
    alone = [explained_by_groups(random.random(50), random.normal(size=50), 8) for _ in range(400)]
    assert np.mean(alone) < 0.05


def test_a_value_that_never_changes_explains_nothing() -> None:
    assert explained_by_groups(np.ones(50), np.arange(50.0), 8) == 0.0
    assert explained_by_groups(np.arange(50.0), np.ones(50), 8) == 0.0


def test_what_was_rounded_is_off_by_a_uniform_error() -> None:
    values = np.random.default_rng(5).uniform(0.0, 10.0, 20_000)
    assert float(np.std(values - np.round(values / 0.5) * 0.5)) == pytest.approx(uniform_sd(0.5), rel=0.02)
