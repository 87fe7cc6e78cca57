"""The repertoire of a search: good gaits unlike each other and its winner, those first that go straight."""

import numpy as np
import pytest
from outcomes import FAST, looking_for, walk

from gaitopt.campaign.merit import merit, merit_of_means
from gaitopt.campaign.repertoire import repertoire
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import judge
from gaitopt.optimise.journal import Entry

ERROR = 0.075
PROBLEM = looking_for(FAST)
SPACE = PROBLEM.space


def entry(index: int, at: float, speed: float, drift: float, tilt: float = 0.1, status: str = "ok") -> Entry:
    """A gait somewhere on the diagonal of the gait space, as a search judges it."""
    point = SPACE.encode(SPACE.decode(np.full(len(SPACE.circular), at)))
    evaluation = judge(PROBLEM, [walk(speed, drift, tilt, status)])
    return Entry(index, "test", point, SPACE.decode(point), evaluation, 1.0)


def chosen(entries: list[Entry], winner: Gait, count: int = 3) -> list[int]:
    """Return the indices of the entries that are chosen."""
    gaits = repertoire(entries, PROBLEM, winner, count, ERROR)
    return [next(one.index for one in entries if one.gait == gait) for gait in gaits]


def test_a_straight_gait_comes_before_a_faster_one_that_drifts() -> None:
    won, aside, straight = (entry(0, 0.2, 0.07, 0.08), entry(1, 0.5, 0.068, 0.09), entry(2, 0.8, 0.06, 0.0))
    assert chosen([won, aside, straight], won.gait) == [2, 1]


def test_near_copies_and_the_winner_are_left_out() -> None:
    won, near, far = entry(0, 0.2, 0.07, 0.0), entry(1, 0.201, 0.07, 0.0), entry(2, 0.8, 0.02, 0.0)
    again = entry(3, 0.801, 0.03, 0.0)
    assert chosen([won, near, far, again], won.gait) == [3]


def test_gaits_that_failed_or_break_a_guarding_limit_come_last() -> None:
    won, failed = entry(0, 0.2, 0.07, 0.0), entry(1, 0.4, 0.09, 0.0, status="diverged")
    tilted, slow = entry(2, 0.6, 0.06, 0.0, tilt=1.5), entry(3, 0.8, 0.01, 0.0)
    assert chosen([won, failed, tilted, slow], won.gait) == [3, 2]
    assert chosen([won, failed, tilted, slow], won.gait, 1) == [3]


@pytest.mark.parametrize("drift", [0.0, 0.09, 0.5])
def test_of_one_robot_the_means_cost_what_its_outcome_does(drift: float) -> None:
    outcomes = [walk(0.05, drift, tilt=0.7)]
    known = judge(PROBLEM, outcomes)
    assert merit_of_means(PROBLEM, known, ERROR) == pytest.approx(merit(PROBLEM, outcomes, 0.0, ERROR).cost)


def test_without_a_limit_on_the_drift_the_cost_of_the_search_counts() -> None:
    free = looking_for(FAST.model_copy(update={"constraints": {}}))
    known = judge(free, [walk(0.05, 0.9)])
    assert merit_of_means(free, known, ERROR) == known.cost
