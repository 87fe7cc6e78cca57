"""Pairs of effects: which are tried, how far they step, and what is learnt where a step failed."""

from concurrent.futures import Executor

import numpy as np
import pytest
from toyfits import toy_bench, toy_fit, toy_point

from gaitopt.diagnose import pairs
from gaitopt.diagnose.fitting import Fit
from gaitopt.diagnose.pairs import PairFit

ROWS = 40
RNG = np.random.default_rng(3)
FIRST, SECOND, THIRD = RNG.standard_normal((3, ROWS))


def fit(name: str, direction: np.ndarray, measured: np.ndarray, target: str = "all") -> Fit:
    """An effect between 0 and 1 that adds its direction, simulated at neutral, 0.5 and 1."""
    bench = toy_bench(ROWS, 4)
    return toy_fit(bench, measured, lambda a: a * direction, (0.0, 0.5, 1.0), name, target)


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
    near = PairFit((one, twin), best.points, best.slopes)
    assert pairs._twins(best, [one, two, twin, other], nominal, [best, near]) == []


def test_few_pairs_of_the_same_effects_are_kept() -> None:
    measured = 0.6 * FIRST + 0.4 * SECOND
    one = fit("one", FIRST, measured)
    tried = [pair_of(one, fit("two", SECOND, measured, t), (0.6, 0.3), measured) for t in "abcd"]
    tried.append(pair_of(one, fit("three", SECOND, measured), (0.1, 0.1), measured))
    kept = pairs._kept(tried, 4)
    assert [pair.names[1] for pair in kept].count("two") == 2
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


def test_of_uneven_cycles_only_the_measurement_may_be_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """What repeats in every cycle makes none of them differ, but a clock that is fast does."""
    measured = 0.6 * FIRST + 0.4 * SECOND
    fits = [fit("one", FIRST, measured), fit("two", SECOND, measured), fit("clock", THIRD, measured)]
    for one in fits:
        one.hypothesis.effect.observe = len if one.hypothesis.effect.name == "clock" else None
    tried: list[list[str]] = []

    def begun(starts, executor, count):  # type: ignore[no-untyped-def]
        tried.append(sorted({fit.hypothesis.effect.name for start in starts for fit in start[:2]}))
        assert not tried[1:] or all("clock" in [f.hypothesis.effect.name for f in s[:2]] for s in starts)
        return []

    monkeypatch.setattr(pairs, "_begun", begun)
    for only in (False, True):
        pairs.fit_pairs(fits, toy_point([], measured), Executor(), lambda *said: None, measured=only)
    assert tried[0] == ["clock", "one", "two"]
    assert "clock" in tried[1]
