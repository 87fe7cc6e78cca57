"""Pairs of effects: which are tried, how far they step, and what a failed step says."""

from collections.abc import Sequence

import numpy as np
import pytest
from toyfits import toy_comparison, toy_fit, toy_trials

from gaitopt.diagnose.fit.pair import PairFit
from gaitopt.diagnose.fit.pair_search import PairSearch
from gaitopt.diagnose.fit.pair_sums import promising_sums
from gaitopt.diagnose.fit.runner import Compare, RobotRequest
from gaitopt.diagnose.fit.settings import PAIRS, PairSettings
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison, TrialSet

ROWS = 40
RNG = np.random.default_rng(3)
FIRST, SECOND, THIRD = RNG.standard_normal((3, ROWS))


def fit(name: str, direction: np.ndarray, measured: np.ndarray, target: str = "all") -> Fit:
    """An effect between 0 and 1 that adds its direction, simulated at neutral, 0.5 and 1."""
    return toy_fit(toy_trials(ROWS, 4), measured, lambda a: a * direction, (0.0, 0.5, 1.0), name, target)


def pair_of(one: Fit, two: Fit, at: tuple[float, float], measured: np.ndarray) -> PairFit:
    left = measured - at[0] * FIRST - at[1] * SECOND
    return PairFit((one, two), [toy_comparison(at, left)], -np.stack([FIRST, SECOND], axis=1))


def as_they_add(fits: Sequence[Fit], measured: np.ndarray) -> Compare:
    """Stands in for the simulator: the changes by two effects add up."""
    by_name = {one.hypothesis.effect.name: one for one in fits}

    def compare(trial_set: TrialSet, requests: Sequence[RobotRequest]) -> list[Comparison | None]:
        found: list[Comparison | None] = []
        for request in requests:
            pairs = zip(request.effects, request.at, strict=True)
            changes = [by_name[name].line(at)[0] - measured for name, at in pairs]
            found.append(toy_comparison(request.at, measured + changes[0] + changes[1]))
        return found

    return compare


def search(fits: Sequence[Fit], measured: np.ndarray, settings: PairSettings = PAIRS) -> PairSearch:
    return PairSearch(fits, toy_comparison([], measured), as_they_add(fits, measured), settings)


def test_an_effect_that_does_the_same_is_tried_in_the_place_of_either() -> None:
    """At the size that changes as much; effects that act differently are not tried."""
    measured = 0.6 * FIRST + 0.4 * SECOND
    one, two = fit("one", FIRST, measured), fit("two", SECOND, measured)
    twin = fit("twin", 0.8 * SECOND + 0.01 * THIRD, measured)
    other = fit("other", THIRD, measured)
    best = pair_of(one, two, (0.6, 0.4), measured)
    looking = search([one, two, twin, other], measured)
    (start,) = looking.twins(best, [best])
    assert [f.hypothesis.effect.name for f in start.fits] == ["one", "twin"]
    assert start.at == pytest.approx([0.6, 0.5], abs=0.01)
    near = PairFit((one, twin), best.comparisons, best.slopes)
    assert looking.twins(best, [best, near]) == []


def test_few_pairs_of_the_same_effects_are_kept() -> None:
    measured = 0.6 * FIRST + 0.4 * SECOND
    one = fit("one", FIRST, measured)
    tried = [pair_of(one, fit("two", SECOND, measured, t), (0.6, 0.3), measured) for t in "abcd"]
    tried.append(pair_of(one, fit("three", SECOND, measured), (0.1, 0.1), measured))
    looking = search([], measured, PairSettings(per_batch=4))
    kept = looking.keep(tried, ())
    assert [pair.names[1] for pair in kept].count("two") == 2
    assert looking.keep(tried, kept) == []
    assert ["one", "three"] in [pair.names for pair in kept]


def test_a_step_goes_no_farther_than_it_may_and_less_far_after_one_that_failed() -> None:
    measured = 0.9 * FIRST + 0.1 * SECOND
    pair = pair_of(fit("one", FIRST, measured), fit("two", SECOND, measured), (0.0, 0.0), measured)
    step = pair.step()
    assert np.abs(step).max() == pytest.approx(PairSettings.max_step)
    worse = toy_comparison(pair.best().at + step, 2.0 * measured)
    pair.learn(worse)
    assert pair.max_step == pytest.approx(0.5 * np.abs(step).max())
    better = toy_comparison(pair.best().at + step, 0.5 * measured)
    pair.learn(better)
    assert pair.best() is better
    assert pair.max_step == pytest.approx(0.5 * np.abs(step).max())


def test_what_adds_up_is_found_where_it_does_not_fit_alone() -> None:
    """Two effects nearly cancel, so that each alone fits best where it does nothing."""
    against = 0.3 * SECOND - FIRST
    measured = FIRST + against
    fits = [fit("one", FIRST, measured), fit("two", against, measured), fit("other", THIRD, measured)]
    assert fits[0].best() < 0.2
    start = promising_sums(fits, toy_comparison([], measured), PairSettings())[0]
    assert [f.hypothesis.name for f in start.fits] == ["one", "two"]
    assert start.at == pytest.approx([1.0, 1.0], abs=0.02)


def test_few_sums_of_the_same_effects_are_tried() -> None:
    measured = 0.6 * FIRST + 0.4 * SECOND
    same = [fit("two", SECOND, measured, target) for target in "abcd"]
    fits = [fit("one", FIRST, measured), *same, fit("other", THIRD, measured)]
    starts = promising_sums(fits, toy_comparison([], measured), PairSettings())
    names = [sorted(f.hypothesis.effect.name for f in start.fits) for start in starts]
    assert names[:2] == [["one", "two"]] * 2
    assert sorted(map(tuple, names[2:])) == [("one", "other"), ("other", "two"), ("other", "two")]


def test_no_pair_is_begun_twice() -> None:
    """It does not matter which of the two fits best alone."""
    measured = 0.4 * FIRST + 0.6 * SECOND
    fits = [fit("one", FIRST, measured), fit("two", SECOND, measured), fit("other", THIRD, measured)]
    begun = [frozenset(f.hypothesis.name for f in start.fits) for start in search(fits, measured).starts()]
    assert len(begun) == len(set(begun)) == 3


def test_what_does_the_same_as_one_of_the_best_is_fitted_as_far() -> None:
    """A known pair and an untried one end where the best is; pairs that differ are left out."""
    measured = 0.6 * FIRST + 0.4 * SECOND
    one, two = fit("one", FIRST, measured), fit("two", SECOND, measured)
    twin, fresh = fit("twin", 0.8 * SECOND, measured), fit("fresh", 1.6 * FIRST, measured)
    other = fit("other", THIRD, measured)
    best = pair_of(one, two, (0.6, 0.4), measured)
    slopes = -np.stack([SECOND, FIRST], axis=1)
    behind = PairFit((twin, one), [toy_comparison((0.2, 0.2), 0.5 * measured)], slopes)
    new = search([one, two, twin, fresh, other], measured).fit_substitutes([best, behind])
    assert [pair.names for pair in new] == [["two", "fresh"]]
    assert behind.best().at == pytest.approx([0.5, 0.6], abs=1e-6)
    assert new[0].best().at == pytest.approx([0.4, 0.375], abs=1e-6)
    assert np.abs(behind.best().whitened).max() < 1e-6


@pytest.mark.parametrize(("size", "batches"), [(0.1, 1), (100.0, PairSettings.batches)])
def test_more_pairs_are_fitted_while_the_best_is_far_from_right(size: float, batches: int) -> None:
    """28 pairs are simulated once each; none explains a large gap."""
    measured = size * FIRST
    fits = [fit(name, RNG.standard_normal(ROWS), measured) for name in "abcdefgh"]
    looking = search(fits, measured, PairSettings(simulated_sums=28))
    assert len(looking.starts()) == 28
    kept = looking.fit_batches()
    assert len({id(pair) for pair in kept}) == batches * PairSettings.per_batch
    assert all(len(pair.comparisons) > 1 for pair in kept[:: PairSettings.per_batch])


def test_two_planted_effects_are_found_among_others() -> None:
    """The whole search, to the coordinates that were planted."""
    measured = 0.7 * FIRST + 0.2 * SECOND
    directions = {"one": FIRST, "two": SECOND, "other": THIRD, "more": RNG.standard_normal(ROWS)}
    fits = [fit(name, direction, measured) for name, direction in directions.items()]
    best = min(search(fits, measured).run(), key=lambda pair: pair.loss)
    assert dict(zip(best.names, best.best().at, strict=True)) == pytest.approx({"one": 0.7, "two": 0.2})
