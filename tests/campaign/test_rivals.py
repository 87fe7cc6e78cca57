"""Bayesian optimisation on a robot, without a simulator."""

import numpy as np

from gaitopt.campaign.rivals import Tried, bayesian_optimisation, best_of, trial_and_error
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem


def test_it_films_gaits_known_by_hand_and_then_better_ones(strider: Problem) -> None:
    space = strider.space
    goal = np.full(len(space.variables), 0.4)

    def film(gait: Gait) -> Tried:
        return Tried(gait, 0.1 * float(np.exp(-2.0 * np.sum((space.encode(gait) - goal) ** 2))))

    starts = list(strider.baselines.values())
    tried = bayesian_optimisation(space, starts, film, 12, 1)
    again = bayesian_optimisation(space, starts, film, 12, 1)
    assert [one.gait.key for one in tried] == [one.gait.key for one in again]
    assert [one.gait for one in tried[:2]] == starts
    assert max(one.speed_m_s for one in tried) > 1.2 * max(one.speed_m_s for one in tried[:2])


def test_it_finds_gaits_that_go_straight_enough(strider: Problem) -> None:
    """The fastest gaits drift: the speed grows along one coordinate, and the drift with it."""
    space = strider.space

    def film(gait: Gait) -> Tried:
        first = float(space.encode(gait)[0])
        return Tried(gait, 0.1 * first, drift=0.4 * first)

    starts = [space.decode(np.full(len(space.variables), share)) for share in (0.05, 0.9)]
    tried = bayesian_optimisation(space, starts, film, 15, 1, most_drift=0.2)
    best = best_of(tried, 0.2)
    assert 0.03 < best.speed_m_s <= 0.05
    assert max(one.speed_m_s for one in tried) > best.speed_m_s
    assert best_of(tried[1:2], 0.2) == tried[1]
    free = bayesian_optimisation(space, starts, film, 15, 1)
    assert best_of(free, np.inf).speed_m_s > 0.09


def test_trial_and_error_leaves_a_gait_that_disappoints(strider: Problem) -> None:
    space, rng = strider.space, np.random.default_rng(1)
    gaits = [space.decode(point) for point in rng.uniform(size=(40, len(space.variables)))]
    archive = [Tried(gait, 0.001 * index) for index, gait in enumerate(gaits)]
    slow = {gait.key for gait in gaits[-3:]}
    tried = trial_and_error(space, archive, lambda gait: Tried(gait, 0.005 if gait.key in slow else 0.03), 6)
    assert tried[0].gait == gaits[-1]
    assert tried[0].speed_m_s == 0.005
    assert tried[-1].gait.key not in slow
