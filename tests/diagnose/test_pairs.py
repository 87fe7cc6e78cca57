"""Pairs of effects: which are tried, how far they step, and what is learnt where a step failed."""

from collections.abc import Callable
from concurrent.futures import Executor
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from toyfits import toy_bench, toy_fit, toy_point

from gaitopt.diagnose.fit import pairs
from gaitopt.diagnose.fit.fitting import Count, Fit
from gaitopt.diagnose.fit.pairs import PairFit

ROWS = 40
RNG = np.random.default_rng(3)
FIRST, SECOND, THIRD = RNG.standard_normal((3, ROWS))


def fit(name: str, direction: np.ndarray, measured: np.ndarray, target: str = "all") -> Fit:
    """An effect between 0 and 1 that adds its direction, simulated at neutral, 0.5 and 1."""
    trial_set = toy_bench(ROWS, 4)
    return toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.5, 1.0), name, target)


def pair_of(one: Fit, two: Fit, at: tuple[float, float], measured: np.ndarray) -> PairFit:
    left = measured - at[0] * FIRST - at[1] * SECOND
    return PairFit((one, two), [toy_point(at, left)], -np.stack([FIRST, SECOND], axis=1))


def test_an_effect_that_does_the_same_is_tried_in_the_place_of_either() -> None:
    """At the size that does as much; what does something else is not tried."""
    measured = 0.6 * FIRST + 0.4 * SECOND
    one, two = fit("one", FIRST, measured), fit("two", SECOND, measured)
    twin = fit("twin", 0.8 * SECOND + 0.01 * THIRD, measured)
    other = fit("other", THIRD, measured)
    best = pair_of(one, two, (0.6, 0.4), measured)
    nominal = toy_point([], measured)
    (start,) = pairs._twins(best, [one, two, twin, other], nominal, [best])
    assert [f.hypothesis.effect.name for f in start[:2]] == ["one", "twin"]
    assert start[2] == pytest.approx([0.6, 0.5], abs=0.01)
    near = PairFit((one, twin), best.comparisons, best.slopes)
    assert pairs._twins(best, [one, two, twin, other], nominal, [best, near]) == []


def test_few_pairs_of_the_same_effects_are_kept() -> None:
    measured = 0.6 * FIRST + 0.4 * SECOND
    one = fit("one", FIRST, measured)
    tried = [pair_of(one, fit("two", SECOND, measured, t), (0.6, 0.3), measured) for t in "abcd"]
    tried.append(pair_of(one, fit("three", SECOND, measured), (0.1, 0.1), measured))
    kept = pairs._kept(tried, 4, ())
    assert [pair.names[1] for pair in kept].count("two") == 2
    assert pairs._kept(tried, 4, kept) == []
    assert ["one", "three"] in [pair.names for pair in kept]


def test_a_step_goes_no_farther_than_it_may_and_less_far_after_one_that_failed() -> None:
    measured = 0.9 * FIRST + 0.1 * SECOND
    pair = pair_of(fit("one", FIRST, measured), fit("two", SECOND, measured), (0.0, 0.0), measured)
    step = pair.step()
    assert np.abs(step).max() == pytest.approx(pairs._FARTHEST)
    worse = toy_point(pair.best().at + step, 2.0 * measured)
    pairs._learn(pair, worse)
    assert pair.farthest == pytest.approx(0.5 * np.abs(step).max())
    better = toy_point(pair.best().at + step, 0.5 * measured)
    pairs._learn(pair, better)
    assert pair.best() is better
    assert pair.farthest == pytest.approx(0.5 * np.abs(step).max())


def test_what_adds_up_is_found_where_it_does_not_fit_alone() -> None:
    """Each of two that nearly undo one another fits best alone where it does nothing."""
    against = 0.3 * SECOND - FIRST
    measured = FIRST + against
    fits = [fit("one", FIRST, measured), fit("two", against, measured), fit("other", THIRD, measured)]
    assert fits[0].best() < 0.2
    one, two, at = pairs._promising(fits, toy_point([], measured))[0]
    assert [one.hypothesis.name, two.hypothesis.name] == ["one", "two"]
    assert at == pytest.approx([1.0, 1.0], abs=0.02)


def test_few_sums_of_the_same_effects_are_tried() -> None:
    measured = 0.6 * FIRST + 0.4 * SECOND
    same = [fit("two", SECOND, measured, target) for target in "abcd"]
    fits = [fit("one", FIRST, measured), *same, fit("other", THIRD, measured)]
    starts = pairs._promising(fits, toy_point([], measured))
    names = [sorted(f.hypothesis.effect.name for f in start[:2]) for start in starts]
    assert names[:2] == [["one", "two"]] * 2
    assert sorted(map(tuple, names[2:])) == [("one", "other"), ("other", "two"), ("other", "two")]


def test_no_pair_is_begun_twice() -> None:
    """Whichever of the two fits best alone."""
    measured = 0.4 * FIRST + 0.6 * SECOND
    fits = [fit("one", FIRST, measured), fit("two", SECOND, measured), fit("other", THIRD, measured)]
    starts = pairs._starts(fits, toy_point([], measured))
    begun = [frozenset((one.hypothesis.name, other.hypothesis.name)) for one, other, _ in starts]
    assert len(begun) == len(set(begun)) == 3


def simulated_as_they_add(measured: np.ndarray) -> Callable[..., Any]:
    """Stands in for the simulator: what two effects change adds up."""

    def simulated(work, executor, count):  # type: ignore[no-untyped-def]
        found = []
        for pair, at in work:
            changes = [pairs._line(f, float(a))[0] - measured for f, a in zip(pair.fits, at, strict=True)]
            found.append((pair, toy_point(at, measured + changes[0] + changes[1])))
        return found

    return simulated


def test_what_does_the_same_as_one_of_the_best_is_fitted_as_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """A known pair and one that was not tried end where the best is; what differs is left out."""
    measured = 0.6 * FIRST + 0.4 * SECOND
    one, two = fit("one", FIRST, measured), fit("two", SECOND, measured)
    twin, fresh = fit("twin", 0.8 * SECOND, measured), fit("fresh", 1.6 * FIRST, measured)
    other = fit("other", THIRD, measured)
    best = pair_of(one, two, (0.6, 0.4), measured)
    behind = PairFit((twin, one), [toy_point((0.2, 0.2), 0.5 * measured)], -np.stack([SECOND, FIRST], axis=1))
    monkeypatch.setattr(pairs, "_simulated", simulated_as_they_add(measured))
    count = Count("", lambda *said: None)
    tried = [best, behind]
    new = pairs._beside(tried, [one, two, twin, fresh, other], toy_point([], measured), Executor(), count)
    assert [pair.names for pair in new] == [["two", "fresh"]]
    assert behind.best().at == pytest.approx([0.5, 0.6], abs=1e-6)
    assert new[0].best().at == pytest.approx([0.4, 0.375], abs=1e-6)
    assert np.abs(behind.best().whitened).max() < 1e-6


def test_more_pairs_are_fitted_while_the_best_is_far_from_right(monkeypatch: pytest.MonkeyPatch) -> None:
    batches: list[int] = []
    monkeypatch.setattr(pairs, "_improve", lambda batch, *rest: batches.append(len(batch)))
    monkeypatch.setattr(pairs, "_simulated", lambda work, executor, count: [])
    direction = {name: RNG.standard_normal(ROWS) for name in "abcdefgh"}
    for size, most in ((0.1, 1), (100.0, pairs._BATCHES)):
        measured = size * FIRST
        fits = [fit(name, direction[name], measured) for name in direction]
        begun = [pair_of(a, b, (0.5, 0.5), measured) for a, b in combinations(fits, 2)]
        monkeypatch.setattr(pairs, "_begun", lambda starts, *rest, begun=begun: begun)
        batches.clear()
        kept = pairs._searched(fits, toy_point([], measured), Executor(), Count("", lambda *said: None))
        assert batches == [pairs._PAIRS] * most
        assert len({id(pair) for pair in kept}) == most * pairs._PAIRS
