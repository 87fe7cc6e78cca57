"""The surrogate: chooses points with low cost, knows that a phase is circular, and saves evaluations."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.solution import Box
from gaitopt.optimise.solvers.solver import Minimisation
from gaitopt.optimise.solvers.surrogate import most_promising

Points = NDArray[np.float64]

FREE = np.zeros(4, dtype=bool)


def bowl(x: Points) -> Points:
    """A narrow bowl about 0.4, its costs spread over many orders of magnitude."""
    return np.exp(8.0 * np.abs(x - 0.4).sum(axis=1))


def test_it_chooses_what_lies_low() -> None:
    """Of 60 candidates the ten chosen are nearly the ten best, and the best of them come first."""
    rng = np.random.default_rng(1)
    points, candidates = rng.uniform(size=(200, 4)), rng.uniform(size=(60, 4))
    chosen = most_promising(points, bowl(points), candidates, 10, FREE)
    ranks = np.searchsorted(np.sort(bowl(candidates)), bowl(chosen))
    assert chosen.shape == (10, 4)
    assert ranks.mean() < 10.0  # 29.5 by chance
    assert ranks[:5].mean() < ranks[5:].mean() + 5.0


def test_ranks_alone_count() -> None:
    """A penalty a million times as large as any difference in speed changes nothing."""
    rng = np.random.default_rng(2)
    points, candidates = rng.uniform(size=(80, 4)), rng.uniform(size=(30, 4))
    costs = bowl(points)
    harsh = np.where(costs > np.median(costs), 1e6 * costs, costs)
    chosen = most_promising(points, costs, candidates, 8, FREE)
    assert np.array_equal(chosen, most_promising(points, harsh, candidates, 8, FREE))


@pytest.mark.parametrize("turns", [-2.0, 0.0, 1.0])
def test_a_phase_is_a_circle(turns: float) -> None:
    """Points just below 1 predict candidates just above 0, on every turn of the circle."""
    circular = np.array([True, False])
    around = np.linspace(0.0, 1.0, 21)[:-1]
    points = np.array([[phase + turns, y] for phase in around for y in (0.2, 0.8)])
    costs = 1.0 - np.cos(2.0 * np.pi * (points[:, 0] - 0.99))
    candidates = np.array([[0.5, 0.5], [0.02, 0.5], [0.3, 0.5], [0.75, 0.5]])
    assert most_promising(points, costs, candidates, 1, circular).tolist() == [[0.02, 0.5]]


@pytest.mark.parametrize("count", [0, 1, 4])
def test_it_chooses_nothing_by_a_handful_of_points(count: int) -> None:
    points = np.random.default_rng(3).uniform(size=(count, 4))
    candidates = np.random.default_rng(4).uniform(size=(9, 4))
    chosen = most_promising(points, bowl(points), candidates, 3, FREE)
    assert np.array_equal(chosen, candidates[:3])


def test_equal_points_and_equal_costs_are_no_trouble() -> None:
    points = np.repeat(np.random.default_rng(5).uniform(size=(10, 4)), 3, axis=0)
    candidates = np.random.default_rng(6).uniform(size=(9, 4))
    chosen = most_promising(points, np.zeros(30), candidates, 3, FREE)
    assert {tuple(row) for row in chosen} <= {tuple(row) for row in candidates}


def test_the_search_gets_further_with_it() -> None:
    """150 evaluations of a bowl in ten dimensions, from the same starts, with and without."""

    def ended(seed: int, chosen: bool) -> float:
        asked: list[Points] = []

        def evaluate(x: Points) -> Points:
            asked.extend(x)
            return ((x - 0.4) ** 2 * np.logspace(0.0, 2.0, 10)).sum(axis=1)

        def choose(candidates: Points, count: int) -> Points:
            points = np.array(asked).reshape(-1, 10)
            costs = ((points - 0.4) ** 2 * np.logspace(0.0, 2.0, 10)).sum(axis=1)
            return most_promising(points, costs, candidates, count, np.zeros(10, dtype=bool))

        start, rng = np.full(10, 0.7), np.random.default_rng(seed)
        box = Box(np.zeros(10, dtype=bool))
        task = Minimisation(evaluate, box, start, 0.1, 150, rng, choose if chosen else None)
        solution = CmaEs().minimise(task)
        assert solution.evaluations == len(asked) == 150
        return solution.cost

    with_it, without = (np.median([ended(seed, chosen) for seed in range(5)]) for chosen in (True, False))
    assert with_it < without / 2.0
