"""The verdict: when one effect is not enough."""

import numpy as np
import pytest
from toyfits import toy_comparison, toy_fit, toy_trials

from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.verdict import falls_short

ROWS = 60


@pytest.mark.parametrize(("does", "short"), [(0.6, False), (1.0, True), (1.3, True)])
def test_two_effects_are_tried_where_the_best_would_go_on_beyond_its_range(does: float, short: bool) -> None:
    """Even if it leaves no more there than a correct model does."""
    trial_set, rng = toy_trials(ROWS, 6, trials=2), np.random.default_rng(5)
    direction, noise = rng.standard_normal((2, ROWS))
    measured = does * direction + 0.5 * noise
    fit = toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.3, 0.6, 1.0))
    judgement = Judgement(trial_set, toy_comparison([], measured), (fit,))
    (best,) = judgement.singles
    assert best.left(trial_set) < 1.2
    assert falls_short(judgement) == short


def test_two_effects_are_tried_where_the_best_leaves_more_than_a_right_one() -> None:
    trial_set, rng = toy_trials(ROWS, 6, trials=2), np.random.default_rng(5)
    direction, noise = rng.standard_normal((2, ROWS))
    measured = 0.5 * direction + 1.5 * noise
    fit = toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.3, 0.6, 1.0))
    assert not fit.hypothesis.at_bound(fit.best())
    assert falls_short(Judgement(trial_set, toy_comparison([], measured), (fit,)))
