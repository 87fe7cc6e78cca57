"""How rough the loss of a set is, and how wide that makes intervals."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from toysets import Response, ToyBench, curved

from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.settings import SETS
from gaitopt.diagnose.judge.chords import WideChords
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.set_judge import SetJudge

Array = NDArray[np.float64]

ROWS, TRIALS = 240, 8
TRUE = 0.5


def jumping(smooth: Response, size: float | Array, width: float) -> Response:
    """A response that jumps by chance from each piece of its range to the next, so far in each row."""

    def response(value: float) -> Array:
        piece = np.random.default_rng(int(value / width)).standard_normal(ROWS)
        found: Array = smooth(value) + size * piece * (value > 0.0)
        return found

    return response


def judged(seed: int, jump: float | Array, trials: int = TRIALS, *, together: bool = True) -> JudgedSets:
    """The judged set of one effect of size `TRUE`, whose response jumps so far in each row."""
    rng = np.random.default_rng(seed)
    smooth = curved(rng, ROWS, 20.0)
    measured = smooth(TRUE) + rng.standard_normal(ROWS)
    toy = ToyBench({"cause": jumping(smooth, jump, 2e-4)}, measured, trials)
    unused: Any = None
    fitter, fit = toy.fitter(), toy.search().run()[0]
    judge = SetJudge(unused, fitter.loss, fitter, SETS, unused)
    candidate: Any = SimpleNamespace(hypotheses=fit.hypotheses, together=fit)
    wide = WideChords.of(fitter, [fit])
    wide = wide.together() if together else wide
    return JudgedSets(judge, (candidate,), np.zeros(1), 0.0, (), np.zeros(ROWS), wide=wide)


def covered(sets: JudgedSets) -> bool:
    (low, high), *_ = sets.intervals(sets.candidates[0], np.zeros((1, ROWS)))
    return low <= TRUE <= high


@pytest.mark.parametrize("jump", [0.0, 0.3, 1.0])
def test_intervals_cover_whatever_the_response_jumps(jump: float) -> None:
    every = [judged(seed, jump) for seed in range(12)]
    assert sum(covered(sets) for sets in every) >= 10
    if jump > 0.2:  # slopes between near values count each jump as what the effect does
        assert sum(covered(replace(sets, wide=None)) for sets in every) <= 8


def test_a_smooth_response_is_not_rough() -> None:
    sets = judged(1, 0.0)
    assert sets.wide is not None
    assert sets.wide.roughness.max() < 0.5
    low, high = sets.intervals(sets.candidates[0], np.zeros((1, ROWS)))[0]
    below, above = replace(sets, wide=None).intervals(sets.candidates[0], np.zeros((1, ROWS)))[0]
    assert high - low == pytest.approx(above - below, rel=0.1)


def width(sets: JudgedSets) -> float:
    (low, high), *_ = sets.intervals(sets.candidates[0], np.zeros((1, ROWS)))
    return high - low


def test_a_trial_that_jumps_tells_little_and_leaves_the_others_their_say() -> None:
    jumps = np.where(np.arange(ROWS) < ROWS // 3, 2.0, 0.0)  # the first of three trials
    each = [judged(seed, jumps, 3, together=False) for seed in range(12)]
    every = [judged(seed, jumps, 3) for seed in range(12)]
    wides = [wide for sets in each if (wide := sets.wide) is not None]
    rough, *others = np.median([wide.roughness for wide in wides], axis=0)
    assert rough > 1.0 > 10.0 * max(others)
    without = np.array([1e9, 0.0, 0.0])
    smooth = [replace(sets, wide=replace(sets.wide, excess=without)) for sets in each if sets.wide]
    for own, alone, together in zip(each, smooth, every, strict=True):
        assert width(own) <= width(alone)
        assert width(own) < 1.05 * width(together)
    assert np.median([width(one) / width(own) for one, own in zip(every, each, strict=True)]) > 1.4
    assert sum(covered(sets) for sets in each) >= 10


def two_effects(seed: int) -> tuple[ToyBench, list[SetFit]]:
    """Two effects whose responses jump, and their sets: the second alone, and both."""
    rng = np.random.default_rng(seed)
    smooth = [curved(rng, ROWS, 20.0) for _ in range(2)]
    measured = smooth[0](TRUE) + smooth[1](TRUE) + rng.standard_normal(ROWS)
    toy = ToyBench(
        {"one": jumping(smooth[0], 1.0, 2e-4), "other": jumping(smooth[1], 1.0, 2e-4)}, measured, TRIALS
    )
    fitter, (one, other) = toy.fitter(), toy.hypotheses
    near = [[(other, TRUE)], [(one, TRUE), (other, TRUE)]]
    return toy, fitter.measure_slopes(fitter.placed(near))


def test_an_effect_goes_aside_in_the_first_set_that_has_it() -> None:
    toy, (alone, both) = two_effects(0)
    wide = WideChords.of(toy.fitter(), [alone, both])
    assert {*wide.slopes} == {"one", "other"}
    np.testing.assert_array_equal(wide.slopes["other"], WideChords.of(toy.fitter(), [alone]).slopes["other"])
    columns = wide.of_set(both).slopes
    np.testing.assert_array_equal(columns, np.column_stack([wide.slopes["one"], wide.slopes["other"]]))


def test_an_effect_of_an_improbable_set_goes_aside_and_says_nothing_of_the_trials() -> None:
    toy, (alone, both) = two_effects(0)
    fitter, probable = toy.fitter(), WideChords.of(toy.fitter(), [alone])
    wide = WideChords.of(fitter, [alone], [both])
    np.testing.assert_array_equal(wide.excess, probable.excess)
    np.testing.assert_array_equal(wide.slopes["other"], probable.slopes["other"])
    np.testing.assert_array_equal(wide.slopes["one"], WideChords.of(fitter, [both]).slopes["one"])
    assert np.any(WideChords.of(fitter, [alone, both]).excess != probable.excess)


def test_a_set_that_did_not_go_aside_borrows_wide_slopes_of_others() -> None:
    toy, (alone, both) = two_effects(0)
    fitter, unused = toy.fitter(), np.zeros((1, ROWS))
    narrow = replace(both, slopes=both.slopes * [1.0, 50.0])  # as jumps between near values have it
    candidate: Any = SimpleNamespace(hypotheses=narrow.hypotheses, together=narrow)
    judge = SetJudge(None, fitter.loss, fitter, SETS, None)  # type: ignore[arg-type]
    sets = JudgedSets(judge, (candidate,), np.zeros(1), 0.0, (), np.zeros(ROWS))
    (_, (low, high)) = sets.intervals(candidate, unused)
    (_, (below, above)) = replace(sets, wide=WideChords.of(fitter, [alone])).intervals(candidate, unused)
    assert above - below > 20.0 * (high - low)
    assert below <= TRUE <= above


def test_a_cause_that_other_evidence_can_replace_is_doubtful() -> None:
    sets, unchanged = judged(0, 0.0), np.zeros((1, ROWS))
    assert not sets.doubtful(unchanged)
    low, high = sets.intervals(sets.candidates[0], unchanged)[0]
    shifted = replace(sets, shifts={"cause": (-2.0 * TRUE, 0.0)})
    assert shifted.intervals(shifted.candidates[0], unchanged)[0] == (0.0, high)
    fit = sets.candidates[0].together
    assert fit is not None
    assert shifted.other_intervals(fit, shifted.covariance(fit, unchanged)) == {"cause": (0.0, high)}
    assert not sets.other_intervals(fit, sets.covariance(fit, unchanged))
    assert shifted.doubtful(unchanged) == {"cause"}
    a_little = replace(sets, shifts={"cause": (-0.1 * low, 0.2 * low)})
    assert a_little.intervals(a_little.candidates[0], unchanged)[0] == pytest.approx(
        (0.9 * low, high + 0.2 * low)
    )
    assert not a_little.doubtful(unchanged)
