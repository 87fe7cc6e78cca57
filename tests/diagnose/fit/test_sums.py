"""Sums of two single effects: what adds up is found, and few of the same effects are tried."""

import numpy as np
import pytest
from toyfits import toy_comparison, toy_fit, toy_trials

from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.sums import best_sums

ROWS = 40
FIRST, SECOND, THIRD = np.random.default_rng(3).standard_normal((3, ROWS))


def fit(name: str, direction: np.ndarray, measured: np.ndarray, target: str = "all") -> Fit:
    """An effect between 0 and 1 that adds its direction, simulated at neutral, 0.5 and 1."""
    return toy_fit(toy_trials(ROWS, 4), measured, lambda a: a * direction, (0.0, 0.5, 1.0), name, target)


def test_what_adds_up_is_found_where_it_does_not_fit_alone() -> None:
    """Two effects nearly cancel, so that each alone fits best where it does nothing."""
    against = 0.3 * SECOND - FIRST
    measured = FIRST + against
    fits = [fit("one", FIRST, measured), fit("two", against, measured), fit("other", THIRD, measured)]
    assert fits[0].best() < 0.2
    first = best_sums(fits, toy_comparison([], measured))[0]
    assert [hypothesis.name for hypothesis, _ in first] == ["one", "two"]
    assert [at for _, at in first] == pytest.approx([1.0, 1.0], abs=0.02)


def test_few_sums_of_the_same_effects_are_tried() -> None:
    measured = 0.6 * FIRST + 0.4 * SECOND
    same = [fit("two", SECOND, measured, target) for target in "abcd"]
    fits = [fit("one", FIRST, measured), *same, fit("other", THIRD, measured)]
    sums = best_sums(fits, toy_comparison([], measured))
    names = [tuple(sorted(hypothesis.effect.name for hypothesis, _ in one)) for one in sums]
    assert names[:3] == [("one", "two")] * 3
    assert sorted(names[3:]) == [("one", "other"), *[("other", "two")] * 3]
