"""Robots drawn from explanations: as often as these are probable, as far as their parameters are known."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toyfits import toy_comparison, toy_trials
from toysets import toy_hypothesis

from gaitopt.diagnose.judge import posterior
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.posterior import Spread, correlation_of, draw_robots

ONE, OTHER = toy_hypothesis("one"), toy_hypothesis("other")


def spread(at: list[float], below: float, above: float, correlation: float = 0.0) -> Spread:
    effects = (ONE, OTHER)[: len(at)]
    together = np.full((len(at), len(at)), correlation)
    np.fill_diagonal(together, 1.0)
    return Spread(effects, np.array(at), np.full(len(at), below), np.full(len(at), above), together)


def drawn(known: Spread, count: int = 20_000) -> np.ndarray:
    rng = np.random.default_rng(1)
    robots = [known.robot(rng.standard_normal(len(known.at))) for _ in range(count)]
    return np.array([[one.value for one in robot] for robot in robots])


def test_parameters_spread_as_far_to_each_side_as_they_are_known() -> None:
    low, middle, high = np.quantile(drawn(spread([0.5], 0.02, 0.08))[:, 0], (0.05, 0.5, 0.95))
    assert middle == pytest.approx(0.5, abs=2e-3)
    assert (0.5 - low, high - 0.5) == pytest.approx((1.645 * 0.02, 1.645 * 0.08), rel=0.03)


def test_parameters_that_were_fitted_together_are_drawn_together() -> None:
    values = drawn(spread([0.5, 0.5], 0.02, 0.02, correlation=-0.9))
    assert np.corrcoef(values.T)[0, 1] == pytest.approx(-0.9, abs=0.02)


def test_other_evidence_says_how_widely_a_parameter_is_drawn() -> None:
    fixed = replace(ONE, low=0.4999, high=0.5001)  # as the jitter of commands is in a fit
    exactly = Spread((fixed, OTHER), np.array([0.5, 0.5]), np.full(2, 1e-5), np.full(2, 0.02), np.eye(2))
    values = drawn(exactly.with_intervals({"one": (0.4, 0.55)}))
    assert np.quantile(values[:, 0], (0.05, 0.5, 0.95)) == pytest.approx((0.4, 0.5, 0.55), abs=3e-3)
    np.testing.assert_array_equal(values[:, 1], drawn(exactly)[:, 1])


@given(st.floats(0.0, 1.2), st.floats(0.0, 3.0))
def test_no_parameter_is_drawn_that_the_effect_does_not_allow(at: float, width: float) -> None:
    low, high = (ONE.coordinate_at(share) for share in ONE.share_limits)
    values = drawn(spread([at], width, width), 50)
    assert ((values >= low) & (values <= high)).all()


def test_a_covariance_gives_the_spread_in_the_parameters_own_units() -> None:
    shares = np.array([[4e-4, 2e-4], [2e-4, 1e-4]])
    known = Spread.of_covariance([ONE, OTHER], [0.4, 0.6], shares)
    assert known.below == pytest.approx([0.02, 0.01])
    assert known.correlation == pytest.approx(np.ones((2, 2)))
    assert correlation_of(np.zeros((2, 2))).tolist() == np.eye(2).tolist()


def causes(scores: list[float], none: float) -> Any:
    candidates = tuple(SimpleNamespace(at=(0.1 * i,)) for i in range(len(scores)))
    sets = JudgedSets(None, candidates, np.array(scores), none, (), np.zeros(0))  # type: ignore[arg-type]
    judgement = Judgement(toy_trials(4, 2), toy_comparison([], np.zeros(4)), sets=sets)
    return SimpleNamespace(candidates=candidates, judgement=judgement)


@pytest.fixture
def known_exactly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posterior, "spread_of", lambda found, candidate: spread(list(candidate.at), 0.0, 0.0))


def test_explanations_are_drawn_as_often_as_they_are_probable(known_exactly: None) -> None:
    robots = draw_robots(causes([math.log(0.5), math.log(0.25)], math.log(0.25)), 1, count=64)
    values = [robot[0].value if robot else None for robot in robots]
    assert [values.count(one) for one in (0.0, 0.1, None)] == [32, 16, 16]


def test_no_effect_is_drawn_where_nothing_was_fitted(known_exactly: None) -> None:
    assert draw_robots(causes([], 0.0), 1, count=3) == ((), (), ())
    assert draw_robots(causes([-1e4], 0.0), 1, count=3) == ((), (), ())


def test_the_same_seed_draws_the_same_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posterior, "spread_of", lambda found, candidate: spread([0.5], 0.1, 0.1))
    found = causes([0.0, -1.0], -2.0)
    assert draw_robots(found, 1) == draw_robots(found, 1) != draw_robots(found, 2)
    assert len(draw_robots(found, 1)) >= 64
