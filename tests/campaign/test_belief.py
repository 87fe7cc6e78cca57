"""What is believed of speeds, and what a film is worth, on made-up robots."""

import numpy as np
import pytest

from gaitopt.campaign.belief import Belief, Filmed, assumed_m_s
from gaitopt.campaign.gaussian_process import Conditioned, matern
from gaitopt.campaign.settings import BELIEF

POINTS = np.array([[0.0, 0.0], [0.1, 0.0], [1.0, 1.0]])
"""Two gaits that are near each other, and one that is far."""

SURE = np.ones(3)
"""Gaits that keep their limits for certain."""

NOTHING = Filmed(np.empty(0, dtype=int), np.empty(0), np.empty(0))


def filmed(gait: int, speed: float, noise: float = 1e-4) -> Filmed:
    return Filmed(np.array([gait]), np.array([speed]), np.array([noise**2]))


def test_the_kernel_is_that_of_the_textbook() -> None:
    assert matern(POINTS[:1], POINTS, 1.0)[0, 0] == 1.0
    apart = np.sqrt(5.0) * 0.1
    known = (1 + apart + apart**2 / 3) * np.exp(-apart)
    assert matern(POINTS[:1], POINTS, 1.0)[0, 1] == pytest.approx(known)


def test_a_process_goes_through_a_measurement_without_noise() -> None:
    process = Conditioned.of(POINTS, POINTS[:1], np.zeros(1), 4.0, 0.5)
    assert process.gain[0, 0] == pytest.approx(1.0)
    assert process.covariance[0, 0] == pytest.approx(0.0, abs=1e-8)
    assert process.covariance[2, 2] == pytest.approx(4.0, rel=0.1)


def test_before_any_film_the_mean_is_that_of_the_robots() -> None:
    speeds = np.array([[0.02, 0.03, 0.04], [0.04, 0.03, 0.02]])
    belief = Belief.of(speeds, POINTS, NOTHING, assumed_m_s(speeds, BELIEF), BELIEF)
    assert belief.mean == pytest.approx([0.03, 0.03, 0.03])
    low, high = belief.expected(0).ci90
    assert low < 0.02 < 0.04 < high


def test_a_film_moves_its_own_gait_and_those_near_it_most() -> None:
    speeds = np.full((3, 3), 0.04)
    after = Belief.of(speeds, POINTS, filmed(0, 0.03), 0.006, BELIEF).mean - 0.04
    assert after[0] == pytest.approx(-0.01, rel=0.02)
    assert after[0] < after[1] < after[2] <= 0.0


def test_robots_count_by_how_well_they_predict_what_was_measured() -> None:
    speeds = np.array([[0.05, 0.05, 0.06], [0.02, 0.02, 0.01]])
    belief = Belief.of(speeds, POINTS, filmed(0, 0.05), 0.0055, BELIEF)
    assert belief.weights[0] > 0.7
    assert belief.mean[2] > 0.045


def test_a_film_that_decides_between_robots_is_worth_more_than_one_that_does_not() -> None:
    speeds = np.array([[0.05, 0.01, 0.03], [0.01, 0.05, 0.03]])
    belief = Belief.of(speeds, np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]]), NOTHING, 0.0045, BELIEF)
    worth = [belief.film_is_worth(gait, 1e-3, [0, 1, 2], SURE) for gait in range(3)]
    assert worth[0] == pytest.approx(worth[1])
    assert worth[0] > 2.0 * worth[2] > 0.0
    assert belief.film_is_worth(0, 10.0, [0, 1, 2], SURE) < 1e-4
    gain = belief.still_to_gain(0, [0, 1, 2], SURE, 1, 500)
    assert 0.0 <= gain.ci90[0] <= gain.mean <= gain.ci90[1]
    assert gain.mean > worth[0]


def test_where_nothing_is_unknown_no_film_is_worth_anything() -> None:
    belief = Belief(np.array([[0.03, 0.02]]), np.ones(1), np.zeros((2, 2)), 0.0)
    assert belief.film_is_worth(0, 1e-3, [0, 1], SURE[:2]) == pytest.approx(0.0, abs=1e-15)
    assert belief.still_to_gain(0, [0, 1], SURE[:2], 1, 50).mean == 0.0


def test_a_film_tells_whether_a_gait_keeps_its_limits() -> None:
    """0.05 m/s with a chance of one half are worth 0.025; after a film, 0.05 or the other gait's 0.03."""
    belief = Belief(np.array([[0.05, 0.03]]), np.ones(1), np.zeros((2, 2)), 0.0)
    chances = np.array([0.5, 1.0])
    assert belief.worth(chances) == pytest.approx([0.025, 0.03])
    certain = Belief(belief.robots, belief.weights, 1e-12 * np.eye(2), 0.0)
    assert certain.film_is_worth(0, 1e-6, [0, 1], chances) == pytest.approx(0.01, rel=1e-3)
    assert certain.film_is_worth(1, 1e-6, [0, 1], chances) == pytest.approx(0.0, abs=1e-5)


def test_a_gait_that_goes_backward_is_worth_no_more_for_breaking_its_limits() -> None:
    belief = Belief(np.array([[-0.02, -0.01]]), np.ones(1), np.zeros((2, 2)), 0.0)
    assert belief.worth(np.array([0.0, 1.0])) == pytest.approx([-0.02, -0.01])


def test_what_may_break_its_limits_is_less_to_gain() -> None:
    belief = Belief(np.array([[0.03, 0.05]]), np.ones(1), np.zeros((2, 2)), 0.0)
    gains = [
        belief.still_to_gain(0, [0, 1], np.array([1.0, share]), 1, 4000).mean for share in (0.0, 0.5, 1.0)
    ]
    assert gains == pytest.approx([0.0, 0.01, 0.02], abs=1e-3)
