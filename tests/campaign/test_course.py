"""How probable it is that a gait keeps its course: by robots, by films, and near what was filmed."""

import numpy as np
import pytest
from scipy import stats

from gaitopt.campaign.belief import Filmed
from gaitopt.campaign.course import chances
from gaitopt.campaign.robots import Walked
from gaitopt.campaign.settings import BELIEF

POINTS = np.array([[0.0, 0.0], [0.05, 0.0], [2.0, 2.0]])
NO_FILMS = Filmed(np.empty(0, dtype=int), np.empty(0), np.empty(0))


def films(drift: float, count: int) -> Filmed:
    """Films of the first gait."""
    return Filmed(np.array([0]), np.array([drift]), np.array([BELIEF.drift_repeatability**2 / count]))


def walked(sideways: list[list[float]], strays: list[list[bool]] | None = None) -> Walked:
    """Robots that walk at 0.05 m/s and drift."""
    drift = np.array(sideways)
    none = np.zeros(drift.shape, dtype=bool)
    return Walked(np.full(drift.shape, 0.05), drift, none, none if strays is None else np.array(strays))


def kept(robots: Walked, drifts: Filmed = NO_FILMS, limit: float = 0.1) -> np.ndarray:
    weights = np.full(len(robots.speeds), 1.0 / len(robots.speeds))
    return chances(robots, weights, POINTS, drifts, limit, BELIEF)


def test_before_any_film_the_assumed_drift_counts() -> None:
    found = kept(walked([[0.0, 0.005, -0.05]]))
    straight = 1.0 - 2.0 * stats.norm.sf(0.1 / BELIEF.drift)
    assert found[0] == pytest.approx(straight)
    assert found[0] > found[1] > 0.4
    assert found[2] < 1e-6


def test_a_film_that_goes_straight_counts_for_its_gait_and_those_near_it() -> None:
    robots = walked([[0.01, 0.01, 0.01]])  # 0.2 of the way
    before = kept(robots)
    after = kept(robots, films(0.0, 2))
    assert after[0] > 0.95
    assert after[0] > after[1] > before[1] + 0.3
    assert after[2] - before[2] < after[1] - before[1]


def test_a_film_that_drifts_ends_the_hope() -> None:
    after = kept(walked([[0.0, 0.0, 0.0]]), films(-0.4, 1))
    assert after[0] < 1e-3


def test_without_a_limit_on_the_drift_robots_that_keep_the_others_count() -> None:
    robots = walked([[9.0, 9.0, 9.0]] * 4, [[True, False, False]] * 3 + [[False, False, False]])
    assert kept(robots, limit=np.inf) == pytest.approx([0.25, 1.0, 1.0])
