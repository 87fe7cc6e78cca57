"""What is concluded from the evidence: sets, probabilities, intervals and shrinkage."""

from types import SimpleNamespace

import numpy as np
import pytest

from gaitopt.diagnose import evidence
from gaitopt.diagnose.fitting import Point


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


def rival(nominal, *changes):
    """A rival of one effect: what its simulated sets change, and a fit that ends at the last of them."""
    points = [
        Point(np.zeros(1), nominal + np.asarray(change), np.empty(0), np.empty(0)) for change in changes
    ]
    best = points[-1].whitened
    losses = np.array([best @ best])
    return evidence.Rival((SimpleNamespace(points=points),), (0.0,), losses, losses, best, np.empty(0), 0.0)


@pytest.mark.parametrize(("planted", "significant"), [(0.0, False), (40.0, True)])
def test_chance_gains_little(planted, significant):
    rng = np.random.default_rng(4)
    direction = rng.standard_normal(200) / np.sqrt(200.0)
    noise = rng.standard_normal(200)
    nominal = Point(np.zeros(1), noise + planted * direction, np.empty(0), np.empty(0))
    rivals = [
        rival(nominal.whitened, -40.0 * direction),
        rival(nominal.whitened, 5.0 * rng.standard_normal(200)),
    ]
    trials = SimpleNamespace(rows_of_blocks=np.array([200.0]))
    gain = float(nominal.whitened @ nominal.whitened) - min(r.evidence for r in rivals)
    chance = evidence.p_value(trials, nominal, rivals, max(gain, 0.0), 1)
    assert (chance <= 0.05) == significant
    assert chance == evidence.p_value(trials, nominal, rivals, max(gain, 0.0), 1)
