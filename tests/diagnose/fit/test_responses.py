"""What effects do alone says which of them are worth a simulation beside a set."""

from dataclasses import replace

import numpy as np
import pytest
from test_sets_of_effects import bench
from toysets import ToyBench

from gaitopt.diagnose.fit.responses import SingleResponses
from gaitopt.diagnose.fit.set_search import SetSearch
from gaitopt.diagnose.fit.settings import GAIT_SETS
from gaitopt.diagnose.fit.single import Fit, robot_request


def responses(rig: ToyBench, shares: tuple[float, ...] = (0.2, 0.6, 1.0)) -> SingleResponses:
    """Each effect of a bench, simulated alone at some shares of its range."""
    fits = []
    for h in rig.hypotheses:
        neutral = replace(rig.nominal, at=np.zeros(1))
        alone = [rig.compared(robot_request([(h, share)])) for share in shares]
        fits.append(Fit(h, None, [neutral, *alone]))  # type: ignore[arg-type]
    return SingleResponses.of_fits(fits, rig.nominal)


def search(rig: ToyBench, begin: tuple[str, ...] = ()) -> SetSearch:
    fitter = rig.fitter(GAIT_SETS)
    points = [(h, 0.5) for h in rig.hypotheses if h.name in begin]
    return SetSearch(
        fitter,
        rig.hypotheses,
        rig.nominal,
        GAIT_SETS,
        fitter,
        begin=[points] if points else [],
        responses=responses(rig),
    )


def test_beside_another_robot_the_changes_add() -> None:
    rig = bench({"effect_0": 0.4}, 1)
    other = rig.compared(robot_request([(rig.hypotheses[1], 0.3)]))
    found = responses(rig).beside(other, rig.hypotheses[0])
    assert [at for at, _ in found] == [0.2, 0.6, 1.0]
    for at, robot in found:
        expected = other.whitened - rig.responses["effect_0"](at)
        np.testing.assert_allclose(robot.whitened, expected)
        np.testing.assert_array_equal(robot.at, [0.3, at])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_planted_effects_are_found_with_few_robots(seed: int) -> None:
    planted = {"effect_0": 0.5, "effect_4": 0.3, "effect_5": 0.6}
    rig = bench(planted, seed, effects=24)
    found = search(rig)
    rig.simulated = 0
    best = found.run()[0]
    assert best.names == set(planted)
    for h, at in best.point:
        assert at == pytest.approx(planted[h.name], abs=0.05)
    assert rig.simulated < 24 * 3 * 3  # fewer than trying each at three values beside each set


def test_a_search_that_sets_out_from_a_wrong_set_leaves_it() -> None:
    planted = {"effect_0": 0.5, "effect_4": 0.3}
    best = search(bench(planted, 2), begin=("effect_1", "effect_4")).run()[0]
    assert best.names == set(planted)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_effects_that_hide_each_other_are_found_from_their_sum(seed: int) -> None:
    """Beside nothing neither of them helps."""
    rig = bench({}, seed)
    common, own = rig.responses["effect_1"], rig.responses["effect_2"]
    others = {"less": lambda value: 0.5 * own(value) - common(value), "more": common}
    rig.responses = {"effect_3": rig.responses["effect_3"]} | others
    rig.measured = rig.measured + sum(response(0.5) for response in others.values())
    assert not search(rig).run()[0].hypotheses
    assert search(rig, begin=("less", "more")).run()[0].names == {"less", "more"}


def test_nothing_is_found_where_nothing_is_wrong() -> None:
    assert not search(bench({}, 4)).run()[0].hypotheses


def test_an_effect_that_does_nearly_the_same_is_fitted_in_place_of_a_found_one() -> None:
    """So that a reader learns of it: neither fits much better."""
    rig = bench({"effect_0": 0.5, "effect_4": 0.3}, 2)
    own, aside = rig.responses["effect_0"], rig.responses["effect_7"]
    rig.responses["effect_8"] = lambda value: own(value) + 0.2 * aside(value)
    found = search(rig, begin=("effect_0", "effect_4"))
    found.run()
    assert frozenset({"effect_8", "effect_4"}) in found.found


def test_the_likes_of_one_effect_do_not_take_the_places_of_those_of_another() -> None:
    rig = bench({"effect_0": 0.5, "effect_4": 0.3}, 2, effects=14)
    one, other, aside = (rig.responses[f"effect_{i}"] for i in (0, 4, 7))
    for number in (1, 2, 3, 5, 6, 9, 10, 11, 12):
        rig.responses[f"effect_{number}"] = lambda value, i=number: one(value) + 0.02 * i * aside(value)
    rig.responses["effect_8"] = lambda value: other(value) + 0.6 * aside(value)
    found = search(rig, begin=("effect_0", "effect_4"))
    found.run()
    assert any("effect_8" in names and len(names) == 2 for names in found.found)


def test_the_likest_robot_is_that_of_the_nearest_value() -> None:
    rig = bench({}, 3)
    h, other = rig.hypotheses[0], rig.hypotheses[1]
    wanted = rig.compared(robot_request([(h, 0.55)]))
    at, robot, cosine = responses(rig).likest(rig.nominal, wanted, h)
    assert (at, robot is not None) == (0.6, True)
    assert cosine == pytest.approx(1.0, abs=0.01)
    assert abs(responses(rig).likest(rig.nominal, wanted, other)[2]) < 0.3
