"""What is concluded from the evidence: sets, probabilities, intervals and shrinkage."""

import numpy as np
import pytest

from gaitopt.diagnose import evidence


def test_probabilities_sum_to_one_and_keep_their_order():
    chances = evidence.probabilities(np.array([-1e5, -3.0, 0.0]))
    assert chances.sum() == pytest.approx(1.0)
    assert chances[2] > chances[1] > chances[0] == 0.0


@pytest.mark.parametrize(
    ("chances", "named"),
    [
        ({"a": 0.99, "b": 0.01}, ["a"]),
        ({"a": 0.6, "b": 0.38, "c": 0.02}, ["a", "b"]),
        ({"a": 0.5, "b": 0.45, "c": 0.05}, ["a", "b", "c"]),
    ],
)
def test_the_answer_is_what_cannot_be_ruled_out(chances, named):
    assert evidence.answer_set(chances) == named


def test_blocks_are_drawn_within_their_trial():
    groups = np.array([0, 0, 0, 1, 1])
    weights = evidence.resampled(groups, np.random.default_rng(1))
    assert (weights[:3].sum(), weights[3:].sum()) == (3.0, 2.0)


def test_shrinkage_counts_what_is_above_the_floor():
    assert evidence.shrinkage(5.0, 1.0, 1.0) == 1.0
    assert evidence.shrinkage(5.0, 3.0, 1.0) == 0.5
    assert evidence.shrinkage(1.0, 0.5, 2.0) is None
