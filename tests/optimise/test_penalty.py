"""The penalties of a search: each limit costs as little as it takes that the better gaits keep it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.optimise.evaluator import DROPPED
from gaitopt.optimise.penalty import Penalty, PenaltySettings
from gaitopt.simulation.objective import FAILED_COST, Evaluation

FULL = 0.05
SETTINGS = PenaltySettings()
SIZES = st.floats(0.0, 10.0)


def walk(speed: float, drift: float = 0.0, tilt: float = 0.0, status: str = "ok") -> Evaluation:
    """The evaluation of a gait, with its excess over two limits."""
    return Evaluation(-speed + FULL * (drift + tilt), {}, {"drift": drift, "tilt": tilt}, status)


def beginning() -> Penalty:
    return Penalty(FULL, ("drift", "tilt"))


@given(SIZES, SIZES)
def test_a_broken_limit_costs_its_share(drift: float, tilt: float) -> None:
    penalty = beginning()
    penalty.shares["tilt"] = 1.0
    expected = -0.04 + FULL * (SETTINGS.first * drift + tilt)
    assert penalty.cost(walk(0.04, drift, tilt)) == pytest.approx(expected, abs=1e-12)


def test_a_gait_that_keeps_every_limit_costs_what_the_objective_says() -> None:
    assert beginning().cost(walk(0.04)) == -0.04


def test_only_the_limit_that_most_of_the_better_gaits_break_costs_more() -> None:
    penalty = beginning()
    better = [walk(0.08, drift=0.5), walk(0.07, drift=0.4), walk(0.06)]
    worse = [walk(0.02, tilt=1.0), walk(0.01, tilt=1.0), walk(0.0, tilt=1.0)]
    before = [penalty.cost(one) for one in better + worse]
    assert penalty.costs(better + worse).tolist() == before
    factor = SETTINGS.factor
    assert penalty.shares == pytest.approx({"drift": 0.2 * factor, "tilt": 0.2 / factor})


def test_shares_stay_between_the_least_and_the_full_penalty() -> None:
    penalty = beginning()
    for _ in range(50):
        penalty.costs([walk(0.05, drift=1.0), walk(0.04, drift=1.0)])
    assert penalty.shares == {"drift": 1.0, "tilt": SETTINGS.least}
    for _ in range(50):
        penalty.costs([walk(0.05, tilt=1.0), walk(0.04, tilt=1.0)])
    assert penalty.shares == {"drift": SETTINGS.least, "tilt": 1.0}


def test_a_dropped_gait_costs_as_much_as_the_worst_of_the_others_and_decides_nothing() -> None:
    penalty = beginning()
    dropped = walk(0.09, tilt=1.0, status=f"{DROPPED} after 1 of 3 scenarios")
    costs = penalty.costs([dropped, walk(0.05), walk(0.01)])
    assert costs.tolist() == [-0.01, -0.05, -0.01]
    assert penalty.shares["tilt"] < SETTINGS.first


def test_a_population_that_failed_changes_nothing() -> None:
    penalty = beginning()
    failed = Evaluation(FAILED_COST, {}, {}, "diverged: badqacc")
    assert penalty.costs([failed, failed]).tolist() == [FAILED_COST, FAILED_COST]
    assert set(penalty.shares.values()) == {SETTINGS.first}


@given(st.lists(st.tuples(SIZES, SIZES, SIZES), min_size=1, max_size=12))
def test_a_penalty_never_exceeds_the_full_one(rows: list[tuple[float, float, float]]) -> None:
    penalty, population = beginning(), [walk(*row) for row in rows]
    full = np.array([one.cost for one in population])
    free = np.array([-row[0] for row in rows])
    for _ in range(3):
        costs = penalty.costs(population)
        assert np.all(costs <= full + 1e-12)
        assert np.all(costs >= free - 1e-12)
