"""What is concluded from the evidence: sets, probabilities and chance."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pytest
from toyfits import toy_comparison, toy_fit, toy_trials

from gaitopt.diagnose.fit.settings import RESPONSE
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.diagnose.judge import evidence
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.settings import EvidenceSettings


def test_probabilities_sum_to_one_and_keep_their_order() -> None:
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
def test_the_answer_is_what_cannot_be_ruled_out(chances: dict[str, float], named: list[str]) -> None:
    assert evidence.answer_set(chances) == named


ROWS = 40
SHOWN = np.concatenate([np.ones(ROWS // 2), np.zeros(ROWS // 2)])
"""An effect that the first of two trials shows, and the second does not."""


def of_two_trials(
    measured: np.ndarray,
    predicted: Callable[[float], np.ndarray],
    at: Sequence[float] = (0.0, 0.4, 0.6, 1.0),
    name: str = "toy",
) -> Candidate:
    return Candidate.of_fit(toy_fit(toy_trials(ROWS, 4, trials=2), measured, predicted, at, name=name))


def trials_of(candidate: Candidate) -> TrialSet:
    assert candidate.alone is not None
    return candidate.alone.trial_set


def test_a_trial_that_shows_nothing_says_nothing_against_a_candidate() -> None:
    """The second trial allows any value, so it predicts nothing about the first."""
    found = of_two_trials(3.0 * SHOWN, lambda a: 6.0 * a * SHOWN)
    assert found.alone is not None
    loss = found.alone.loss(np.array([0.0, 0.0, 1.0, 1.0]))
    assert loss[:2].sum() == pytest.approx(9.0 * ROWS / 2)
    assert found.left(trials_of(found)) < 0.01


def test_a_trial_that_shows_an_effect_holds_a_candidate_to_it() -> None:
    """One trial fits 0.5 and the other allows values near 0.1 only, so neither predicts the other."""
    asked = np.where(SHOWN > 0.0, 0.5, 0.1)
    at = np.linspace(0.0, 1.0, 11).tolist()
    found = of_two_trials(40.0 * asked, lambda a: np.full(ROWS, 40.0 * a), at)
    assert found.left(trials_of(found)) > 100.0


def test_a_trial_on_which_the_loss_jumps_takes_nothing_from_another() -> None:
    """A slow gait tells two effects apart; a fast one, where similar robots differ by chance, does not."""
    rng = np.random.default_rng(3)
    at = (0.0, 0.498, 0.5, 0.502, 1.0)
    jumps = 3.0 * rng.standard_normal((len(at), ROWS)) * (1.0 - SHOWN)

    def weights(size: float) -> tuple[float, np.ndarray]:
        right = of_two_trials(2.0 * SHOWN, lambda a: 4.0 * a * SHOWN + size * jumps[at.index(a)], at, "right")
        wrong = of_two_trials(2.0 * SHOWN, lambda a: a * SHOWN + size * jumps[at.index(a)], at, "wrong")
        first, second = evidence.scores(trials_of(right), [right, wrong])
        return first - second, right.loss_jumps(trials_of(right), RESPONSE)

    (calm, none), (jagged, jumped) = weights(0.0), weights(1.0)
    temper, share = EvidenceSettings.temper, EvidenceSettings.jump_share
    assert none == pytest.approx([0.0, 0.0], abs=1e-9)
    assert jumped[0] == pytest.approx(0.0, abs=1e-9)
    assert jumped[1] > 10.0 * temper
    by_all_jumps = calm * temper / (temper + share * jumped[1])
    assert jagged > 2.0 * by_all_jumps > 0.0


def _negative(change: np.ndarray, at: float) -> np.ndarray:
    return -change


@pytest.mark.parametrize(("planted", "significant"), [(0.0, False), (40.0, True)])
def test_chance_gains_little(planted: float, significant: bool) -> None:
    rng = np.random.default_rng(4)
    direction = rng.standard_normal(200) / np.sqrt(200.0)
    noise = rng.standard_normal(200)
    nominal = toy_comparison([0.0], noise + planted * direction)
    trial_set = toy_trials(200, 1)
    changes = (-40.0 * direction, 5.0 * rng.standard_normal(200))
    candidates = []
    for change in changes:
        fit = toy_fit(trial_set, nominal.whitened, partial(_negative, change), (1.0,))
        losses = trial_set.losses(fit.at_best("whitened"))
        candidates.append(
            Candidate(
                (fit.hypothesis,),
                (1.0,),
                losses,
                losses,
                fit.at_best("whitened"),
                np.empty(0),
                np.empty(0),
                fit,
            )
        )
    best = min(candidates, key=lambda candidate: candidate.total_loss)
    chance = evidence.p_value(trial_set, nominal, candidates, best, np.array([True]), 1)
    assert (chance <= 0.05) == significant
    assert chance == evidence.p_value(trial_set, nominal, candidates, best, np.array([True]), 1)


def test_what_one_of_many_unlike_robots_gains_is_chance() -> None:
    """A robot that fits a fast gait by luck proves nothing: those near it, simulated as well, do not fit."""
    rng = np.random.default_rng(5)
    direction = rng.standard_normal(ROWS) * (1.0 - SHOWN)
    measured = 8.0 * direction / np.linalg.norm(direction)
    at = (0.0, 0.498, 0.5, 0.502, 1.0)
    jumps = rng.standard_normal((len(at), ROWS)) * (1.0 - SHOWN)
    jumps[[at.index(0.0), at.index(0.5)]] = 0.0

    def chance(size: float, trials: tuple[bool, bool]) -> float:
        found = of_two_trials(measured, lambda a: 2.0 * a * measured + size * jumps[at.index(a)], at)
        assert found.at == pytest.approx([0.5], abs=0.05)
        nominal = toy_comparison([0.0], measured)
        return evidence.p_value(trials_of(found), nominal, [found], found, np.array(trials), 1)

    assert chance(0.0, (True, True)) < 0.01
    assert chance(3.0, (True, True)) > 0.1
    assert chance(0.0, (True, False)) == 1.0


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 10.0])
def test_held_out_losses_are_predictive_squares(stiffness: float) -> None:
    """A parameter fitted to the other trials has their error, which adds to that of the held-out trial."""
    slopes = np.where(SHOWN > 0.0, 10.0, 10.0 * np.sqrt(stiffness))
    asked = np.where(SHOWN > 0.0, 0.4, 0.6)
    found = of_two_trials(slopes * asked, lambda a: slopes * a, np.linspace(0.0, 1.0, 201).tolist())
    own, others = 100.0 * ROWS / 2, 100.0 * stiffness * ROWS / 2
    both = 0.2**2 / (1.0 / own + 1.0 / others)
    assert trials_of(found).by_trial(found.heldout_loss) == pytest.approx([both, both], rel=2e-3)
