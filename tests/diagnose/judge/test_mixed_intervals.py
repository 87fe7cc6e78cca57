"""Intervals of figures that one of several explanations gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.core.statistics import NORMAL_95
from gaitopt.diagnose.judge.precision import mixed

Part = tuple[float, float, tuple[float, float]]


def part(chance: float, middle: float, below: float, above: float) -> Part:
    return chance, middle, (middle - below, middle + above)


PARTS = st.lists(
    st.builds(part, st.floats(0.01, 1.0), st.floats(-5.0, 5.0), st.floats(0.0, 3.0), st.floats(0.0, 3.0)),
    min_size=1,
    max_size=6,
)


@given(PARTS)
def test_an_interval_lies_within_those_of_the_explanations(parts: list[Part]) -> None:
    low, high = mixed(parts)
    lows, highs = np.array([ends for _, _, ends in parts]).T
    assert lows.min() - 1e-9 <= low <= lows.max() + 1e-9
    assert highs.min() - 1e-9 <= high <= highs.max() + 1e-9
    assert low <= high + 1e-9


@given(PARTS, st.floats(0.1, 10.0))
def test_only_ratios_of_probabilities_count(parts: list[Part], factor: float) -> None:
    scaled = [(factor * chance, middle, ends) for chance, middle, ends in parts]
    assert mixed(scaled) == pytest.approx(mixed(parts), abs=1e-6)


@given(st.floats(-5.0, 5.0), st.floats(0.01, 3.0), st.floats(0.01, 3.0), st.integers(1, 5))
def test_explanations_that_agree_keep_their_interval(
    middle: float, below: float, above: float, count: int
) -> None:
    expected = middle - below, middle + above
    found = mixed([part(0.1 * (1 + k), middle, below, above) for k in range(count)])
    # NORMAL_95 is rounded: the ends are quantiles of 0.05 and 0.95 but for that
    assert found == pytest.approx(expected, abs=1e-3 * (below + above))


def test_half_of_the_draws_of_two_explanations_come_from_each() -> None:
    rng, parts = np.random.default_rng(1), [part(0.5, 0.0, 1.0, 1.0), part(0.5, 4.0, 2.0, 0.5)]
    drawn = []
    for _, middle, (low, high) in parts:
        normal = rng.standard_normal(200_000)
        side = np.where(normal < 0.0, middle - low, high - middle) / NORMAL_95
        drawn.append(middle + normal * side)
    expected = np.quantile(np.concatenate(drawn), (0.05, 0.95))
    assert mixed(parts) == pytest.approx(tuple(expected), abs=0.02)


def test_an_improbable_explanation_hardly_counts() -> None:
    low, high = mixed([part(0.999, 1.0, 0.1, 0.1), part(0.001, 9.0, 0.1, 0.1)])
    assert (low, high) == pytest.approx((0.9, 1.1), abs=2e-3)
