"""Sets of effects are fitted by a robust loss, grown, thinned and exchanged."""

from dataclasses import replace

import numpy as np
import pytest
from toysets import ToyBench, curved, late

from gaitopt.core.streams import seeded
from gaitopt.diagnose.fit.products import Products, RowBlocks
from gaitopt.diagnose.fit.robust import RobustLoss, WideLoss
from gaitopt.diagnose.fit.settings import SETS

TRIALS, EACH = 12, 20
ROWS = TRIALS * EACH


def bench(planted: dict[str, float], seed: int, effects: int = 9) -> ToyBench:
    rng = seeded(seed)
    responses = {
        f"effect_{i}": late(rng, ROWS, 8.0) if i % 3 == 2 else curved(rng, ROWS, 8.0) for i in range(effects)
    }
    measured = rng.standard_normal(ROWS)
    for name, size in planted.items():
        measured = measured + responses[name](size)
    return ToyBench(responses, measured, TRIALS)


def test_the_weights_are_the_slope_of_the_loss() -> None:
    trials = np.repeat(np.arange(3), 10)
    loss = RobustLoss(trials, 4.0, 3.0, 10.0, np.ones(3), np.ones(3), ((0.0, 0.0), (0.5, 0.1), (2.0, 0.0)))
    white = seeded(1).standard_normal(30) * np.repeat([1.0, 3.0, 30.0], 10)
    weights = loss.trial_weights(loss.squares(white))[trials]
    for row in (0, 12, 25):
        aside = white.copy()
        aside[row] += 1e-5
        slope = (loss.total(aside) - loss.total(white)) / 1e-5
        assert slope == pytest.approx(2.0 * weights[row] * white[row], rel=1e-3)


def test_a_trial_that_nothing_fits_hardly_counts() -> None:
    trials = np.repeat(np.arange(3), 10)
    loss = RobustLoss(trials, 4.0, 3.0, 10.0, np.ones(3), np.ones(3))
    weights = loss.trial_weights(loss.squares(np.repeat([1.0, 1.0, 100.0], 10)))
    assert weights[2] < 1e-3 * weights[0]


def test_a_long_trial_counts_as_a_limited_number_of_rows() -> None:
    one = np.ones(1)
    short, long = (RobustLoss(np.zeros(n, dtype=np.intp), 4.0, 3.0, 10.0, one, one) for n in (30, 300))
    assert short.total(2.0 * np.ones(30)) == pytest.approx(long.total(2.0 * np.ones(300)))


def test_trials_share_an_error_that_lies_above_their_floors() -> None:
    trials = np.repeat(np.arange(4), 20)
    errors = ((0.0, 0.0), (0.003, 0.0), (0.01, 0.0), (0.0, 0.02), (0.0, 0.1))
    loss = RobustLoss(trials, 4.0, 3.0, 10.0, np.array([1e6, 1e4, 1e6, 1e4]), np.full(4, 1e4), errors)
    white = seeded(3).standard_normal(80)
    assert loss.shared_error(loss.squares(white)) == (0.0, 0.0)
    off = white * np.repeat([10.0, 1.4, 10.0, 1.4], 20)
    assert loss.shared_error(loss.squares(off)) == (0.01, 0.0)


def test_an_error_may_be_a_share_of_the_motion() -> None:
    trials = np.repeat(np.arange(4), 20)
    errors = ((0.0, 0.0), (0.003, 0.0), (0.01, 0.0), (0.0, 0.02), (0.0, 0.1))
    loss = RobustLoss(trials, 4.0, 3.0, 10.0, np.full(4, 1e6), np.array([1e4, 1e2, 1e4, 1e2]), errors)
    off = seeded(3).standard_normal(80) * np.repeat([10.0, 1.4, 10.0, 1.4], 20)
    assert loss.shared_error(loss.squares(off)) == (0.0, 0.1)


@pytest.mark.parametrize("kind", [RobustLoss, WideLoss])
def test_many_residuals_have_the_losses_of_each(kind: type[RobustLoss]) -> None:
    trials = np.repeat(np.arange(3), (10, 25, 5))
    errors = ((0.0, 0.0), (0.5, 0.1), (2.0, 0.0))
    loss = kind(trials, 4.0, 3.0, 10.0, np.full(3, 2.0), np.ones(3), errors)
    many = seeded(4).standard_normal((6, 40)) * np.geomspace(0.5, 30.0, 6)[:, None]
    np.testing.assert_allclose(loss.totals(many), [loss.total(one) for one in many], rtol=1e-12)


def test_products_tell_what_each_block_leaves_after_a_step() -> None:
    rng = seeded(2)
    white, slopes, step = rng.standard_normal(40), rng.standard_normal((40, 3)), rng.standard_normal(3)
    rows = RowBlocks(np.repeat(np.arange(4), 10), np.array([0, 0, 1, 1]))
    after = white + slopes @ step
    found = Products.of(white, slopes, rows).squares(step)
    np.testing.assert_allclose(found, np.sum(after.reshape(4, 10) ** 2, axis=1))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_effect_alone_is_found_and_sized(seed: int) -> None:
    best = bench({"effect_4": 0.5}, seed).search().run()[0]
    assert best.names == {"effect_4"}
    assert best.shares[0] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_limit_that_acts_only_far_from_neutral_is_found_and_sized(seed: int) -> None:
    """The first step of a fit must not end where the limit does nothing yet: it would stay there."""
    rng = seeded(seed)
    responses = {"limit": late(rng, ROWS, 20.0, begins_at=0.6)}
    responses |= {f"effect_{i}": curved(rng, ROWS, 8.0) for i in range(4)}
    measured = rng.standard_normal(ROWS) + responses["limit"](0.75)
    best = ToyBench(responses, measured, TRIALS).search().run()[0]
    assert best.names == {"limit"}
    assert best.shares[0] == pytest.approx(0.75, abs=0.03)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_limit_is_tried_between_doing_nothing_and_doing_too_much(seed: int) -> None:
    """What it does far beyond is no larger form of what it does near where it is reached."""
    rng = seeded(seed)
    near, far = 40.0 * rng.standard_normal((2, ROWS))

    def limit(value: float) -> np.ndarray:
        beyond = max(0.0, value - 0.4)
        return beyond * near + 4.0 * beyond**2 * far

    toy = ToyBench({"limit": limit}, rng.standard_normal(ROWS) + limit(0.55), TRIALS)
    search = toy.search()
    (tried,) = search._beside.tried(search.fitter.empty(toy.nominal))
    assert tried.share == pytest.approx(0.55, abs=0.06)
    assert toy.simulated <= 6  # three places at first


def test_where_a_set_falls_short_the_search_goes_up_from_other_pairs() -> None:
    planted = {"effect_0": 0.4, "effect_1": 0.5, "effect_3": 0.3}
    search = bench(planted, 1).search(replace(SETS, right=0.5))
    points = {h.name: (h, planted.get(h.name, 0.5)) for h in search.hypotheses}
    begun = [[points["effect_4"], points["effect_6"]], [points["effect_0"], points["effect_3"]]]
    wrong, _ = search._kept(search._refined(search.fitter.placed(begun)))
    assert search._falls_short(wrong)
    best = search._climbed_otherwise(wrong)
    assert best.names == set(planted)


def test_one_effect_takes_the_place_of_two_that_do_the_same_together() -> None:
    """One by one neither gives way to it: beside the other one it does too much."""
    rng = seeded(1)
    first, second, own = 8.0 * rng.standard_normal((3, ROWS))
    responses = {
        "both": lambda value: max(0.0, value - 0.15) * (first + second + 0.5 * own),
        "first": lambda value: value * first,
        "second": lambda value: value * second,
    }
    toy = ToyBench(responses, rng.standard_normal(ROWS) + responses["both"](0.75), TRIALS)
    search = toy.search()
    search._beside.tried(search.fitter.empty(toy.nominal))
    _, one, other = toy.hypotheses
    (two,) = search._kept(search._refined(search.fitter.placed([[(one, 0.5), (other, 0.5)]])))
    search._fit_merged()
    assert search.ranked[0].names == {"both"}
    assert search.ranked[0].shares[0] == pytest.approx(0.75, abs=0.02)
    assert search.fitter.score(search.ranked[0]) < search.fitter.score(two)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_three_effects_are_found_and_sized(seed: int) -> None:
    planted = {"effect_0": 0.4, "effect_2": 0.7, "effect_7": 0.3}
    best = bench(planted, seed).search().run()[0]
    found = dict(zip(best.effects, best.shares.tolist(), strict=True))
    assert set(found) == set(planted)
    assert found == pytest.approx(planted, abs=0.05)


def test_seven_effects_at_once_are_found() -> None:
    planted = {f"effect_{i}": 0.3 + 0.05 * i for i in range(7)}
    best = bench(planted, 4, effects=12).search().run()[0]
    found = dict(zip(best.effects, best.shares.tolist(), strict=True))
    assert {name: found.pop(name) for name in planted} == pytest.approx(planted, abs=0.05)
    assert all(share < 0.05 for share in found.values())


def test_beside_a_set_only_what_promises_much_is_simulated() -> None:
    planted = {"effect_3": 0.4, "effect_14": 0.7, "effect_21": 0.3}
    short, long = (bench(planted, 4, effects=26) for _ in range(2))
    found = short.search().run()[0]
    every = replace(SETS, promising=1000, swapped=1000, promising_targets=1000)
    assert found.names == long.search(every).run()[0].names == set(planted)
    assert short.simulated < 0.8 * long.simulated


def test_a_fit_of_all_effects_begins_without_those_whose_response_is_rough() -> None:
    made = bench({f"effect_{i}": 0.3 + 0.05 * i for i in range(7)}, 4, effects=12)
    made.rough = frozenset({"effect_6"})
    search = made.search()
    search.run()
    widest = max(search.found.values(), key=lambda fit: len(fit.effects))
    assert set(widest.effects) == set(made.responses) - {"effect_6"}


@pytest.mark.parametrize("unusual", ["effect_1", "effect_3"])
def test_of_two_effects_that_do_the_same_the_usual_one_is_found(unusual: str) -> None:
    made = bench({"effect_1": 0.5}, 3)
    made.responses["effect_3"] = made.responses["effect_1"]
    made.unusual = {unusual: 6.0}
    usual = ({"effect_1", "effect_3"} - {unusual}).pop()
    assert made.search().run()[0].names == {usual}


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_noise_alone_has_no_effect(seed: int) -> None:
    best = bench({}, seed).search().run()[0]
    assert best.names == frozenset()


def test_a_trial_that_slipped_does_not_spoil_the_rest() -> None:
    made = bench({"effect_1": 0.5}, 5)
    made.measured[:EACH] += 30.0
    best = made.search().run()[0]
    assert "effect_1" in best.names
    share = dict(zip(best.effects, best.shares.tolist(), strict=True))["effect_1"]
    assert share == pytest.approx(0.5, abs=0.05)


def test_a_robot_that_cannot_be_simulated_is_left_out() -> None:
    made = bench({"effect_4": 0.5}, 1)
    compare = made.simulate
    made.simulate = lambda requests: [  # type: ignore[method-assign]
        None if "effect_3" in request.effects else one
        for request, one in zip(requests, compare(requests), strict=True)
    ]
    assert made.search().run()[0].names == {"effect_4"}


def test_a_search_is_the_same_every_time() -> None:
    first, again = (bench({"effect_0": 0.4, "effect_5": 0.6}, 6).search().run() for _ in range(2))
    assert [fit.loss for fit in first] == [fit.loss for fit in again]


def test_an_effect_that_is_known_is_in_every_set() -> None:
    rng = np.random.default_rng(5)
    shapes = rng.standard_normal((3, 200))
    responses = {
        name: (lambda size, shape=shape: size * shape) for name, shape in zip("abc", shapes, strict=True)
    }
    bench = ToyBench(responses, 4.0 * shapes[1] + rng.standard_normal(200), 4)
    known = replace(bench.hypotheses[0], low=0.499, high=0.501)
    search = replace(bench.search(), known=[(known, 0.5)])
    found = search.run()
    assert all("a" in fit.names for fit in found if fit.hypotheses)
    first = found[0]
    assert first.names == {"a", "b"}
    (at,) = [at for one, at in first.point if one.name == "a"]
    assert at == pytest.approx(0.5, abs=2e-3)
