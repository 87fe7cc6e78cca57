"""What is concluded from the evidence: sets, probabilities, intervals and shrinkage."""

from types import SimpleNamespace

import numpy as np
import pytest
from toyfits import toy_bench, toy_fit

from gaitopt.diagnose.fit.fitting import Comparison
from gaitopt.diagnose.judge import evidence


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


ROWS = 40
SHOWN = np.concatenate([np.ones(ROWS // 2), np.zeros(ROWS // 2)])
"""An effect that the first of two trials shows, and the second does not."""


def of_two_trials(measured, predicted, at=(0.0, 0.4, 0.6, 1.0), name="toy"):
    return evidence.single(
        toy_fit(
            toy_bench(ROWS, 4, problem=SimpleNamespace(channel_names=("servo",)), trials=2),
            measured,
            predicted,
            at,
            name=name,
        )
    )


def test_a_trial_that_shows_nothing_says_nothing_against_a_rival():
    """The first trial is foretold by what the second leaves possible, which is anything."""
    found = of_two_trials(3.0 * SHOWN, lambda a: 6.0 * a * SHOWN)
    trial_set = found.fits[0].trial_set
    assert found.fits[0].loss(np.array([0.0, 0.0, 1.0, 1.0]))[:2].sum() == pytest.approx(9.0 * ROWS / 2)
    assert evidence.left(trial_set, found) < 0.01


def test_a_trial_that_shows_an_effect_holds_a_rival_to_it():
    """Of a trial that asks for 0.5, what the other leaves possible, near 0.1, does not foretell the half."""
    asked = np.where(SHOWN > 0.0, 0.5, 0.1)
    found = of_two_trials(40.0 * asked, lambda a: np.full(ROWS, 40.0 * a), np.linspace(0.0, 1.0, 11))
    assert evidence.left(found.fits[0].trial_set, found) > 100.0


def test_a_trial_on_which_the_loss_jumps_takes_nothing_from_another():
    """A slow gait tells two effects apart; a fast one, where near robots differ by chance, tells nothing."""
    rng = np.random.default_rng(3)
    at = (0.0, 0.498, 0.5, 0.502, 1.0)
    jumps = 3.0 * rng.standard_normal((len(at), ROWS)) * (1.0 - SHOWN)

    def weights(size):
        right = of_two_trials(2.0 * SHOWN, lambda a: 4.0 * a * SHOWN + size * jumps[at.index(a)], at, "right")
        wrong = of_two_trials(2.0 * SHOWN, lambda a: a * SHOWN + size * jumps[at.index(a)], at, "wrong")
        first, second = evidence.scores(right.fits[0].trial_set, [right, wrong])
        return first - second, evidence._luck(right.fits[0].trial_set, right)

    (calm, none), (jagged, luck) = weights(0.0), weights(1.0)
    assert none == pytest.approx([0.0, 0.0], abs=1e-9)
    assert luck[0] == pytest.approx(0.0, abs=1e-9)
    assert luck[1] > 10.0 * evidence.TEMPER
    by_all_luck = calm * evidence.TEMPER / (evidence.TEMPER + evidence.LUCK * luck[1])
    assert jagged > 2.0 * by_all_luck > 0.0


def candidate(nominal, *changes):
    """A candidate of one effect: what its simulated sets change, and a fit that ends at the last of them."""
    points = [
        Comparison(np.zeros(1), nominal + np.asarray(change), np.empty(0), np.empty(0)) for change in changes
    ]
    best = points[-1].whitened
    losses = np.array([best @ best])
    return evidence.Candidate(
        (SimpleNamespace(comparisons=points),), (0.0,), losses, losses, best, np.empty(0), 0.0
    )


@pytest.mark.parametrize(("planted", "significant"), [(0.0, False), (40.0, True)])
def test_chance_gains_little(planted, significant):
    rng = np.random.default_rng(4)
    direction = rng.standard_normal(200) / np.sqrt(200.0)
    noise = rng.standard_normal(200)
    nominal = Comparison(np.zeros(1), noise + planted * direction, np.empty(0), np.empty(0))
    candidates = [
        candidate(nominal.whitened, -40.0 * direction),
        candidate(nominal.whitened, 5.0 * rng.standard_normal(200)),
    ]
    trials = SimpleNamespace(rows_per_block=np.array([200.0]))
    gain = float(nominal.whitened @ nominal.whitened) - min(r.evidence for r in candidates)
    chance = evidence.p_value(trials, nominal, candidates, max(gain, 0.0), 1)
    assert (chance <= 0.05) == significant
    assert chance == evidence.p_value(trials, nominal, candidates, max(gain, 0.0), 1)


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 10.0])
def test_held_out_losses_are_predictive_squares(stiffness):
    """Fitted to others alone a parameter is off by their error, which adds to that of the trial left out."""
    slopes = np.where(SHOWN > 0.0, 10.0, 10.0 * np.sqrt(stiffness))
    asked = np.where(SHOWN > 0.0, 0.4, 0.6)
    found = of_two_trials(slopes * asked, lambda a: slopes * a, np.linspace(0.0, 1.0, 201))
    own, others = 100.0 * ROWS / 2, 100.0 * stiffness * ROWS / 2
    both = 0.2**2 / (1.0 / own + 1.0 / others)
    assert found.fits[0].trial_set.sums(found.heldout_loss) == pytest.approx([both, both], rel=2e-3)
