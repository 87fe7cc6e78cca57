"""Which effects of sets are causes."""

import math
from collections.abc import Iterable, Set
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from toysets import toy_hypothesis

from gaitopt.diagnose.gap.floor import Floor
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.set_verdict import (
    at_work,
    by_own_covariance,
    conclude_sets,
    misfit_trials,
    predicts,
    stand_ins,
)
from gaitopt.diagnose.judge.settings import VerdictSettings
from gaitopt.diagnose.judge.verdict import Verdict

UNUSUAL = {"emf": 6.0}
"""Price of each unusual effect."""


def judged(
    *sets: tuple[float, dict[str, float]], known: tuple[str, ...] = (), small: Set[str] = frozenset()
) -> tuple[Any, Any]:
    """Sets, each with its probability and what its effects change; some effects are small errors."""
    intervals = dict.fromkeys(known, (0.0, 1.0))
    judgement = SimpleNamespace(
        settings=SimpleNamespace(verdict=VerdictSettings(matters=2.0, hinted=0.5)),
        ranking=SimpleNamespace(probabilities=np.array([chance for chance, _ in sets])),
        small_errors=lambda one: small & set(one.names),
    )
    return judgement, JudgedSets(
        None,  # type: ignore[arg-type]
        tuple(candidate(one) for _, one in sets),
        np.log([chance for chance, _ in sets]),
        -np.inf,
        tuple(one for _, one in sets),
        np.zeros(0),
        intervals,
    )


def candidate(names: Iterable[str]) -> Any:
    """A set of effects."""
    hypotheses = [toy_hypothesis(name, unusual=UNUSUAL.get(name, 0.0)) for name in names]
    return SimpleNamespace(hypotheses=hypotheses, names=list(names))


def test_an_effect_is_as_probable_as_the_sets_that_have_it() -> None:
    judgement, sets = judged((0.6, {"lag": 40.0, "trim": 9.0}), (0.3, {"lag": 50.0}), (0.1, {"play": 30.0}))
    assert list(at_work(judgement, sets, 2.0).items()) == [("lag", 0.6 + 0.3), ("trim", 0.6), ("play", 0.1)]


def test_an_effect_that_changes_nearly_nothing_is_no_cause() -> None:
    judgement, sets = judged((0.9, {"lag": 40.0, "gain": 0.3}), (0.1, {"lag": 40.0, "gain": 8.0}))
    assert dict(at_work(judgement, sets, 2.0)) == {"lag": 1.0, "gain": 0.1}


def test_a_small_error_of_the_robot_is_no_cause() -> None:
    sets = (0.9, {"lag": 40.0, "trim": 9.0}), (0.1, {"lag": 40.0})
    assert dict(at_work(*judged(*sets, small={"trim"}), 2.0)) == {"lag": 1.0}


def test_an_effect_that_other_evidence_shows_is_a_cause_whatever_it_changes() -> None:
    judgement, sets = judged((0.9, {"lag": 40.0, "jitter": 0.3}), (0.1, {"jitter": 0.2}), known=("jitter",))
    assert dict(at_work(judgement, sets, 2.0)) == {"lag": 0.9, "jitter": 1.0}


def test_an_unusual_effect_that_does_the_same_as_a_cause_cannot_be_told_from_it() -> None:
    judgement, sets = judged((0.93, {"damping": 40.0}), (0.04, {"emf": 40.0}), (0.03, {"friction": 40.0}))
    assert stand_ins(judgement, sets, ["damping"], 2.0) == ("emf",)


def test_an_unusual_effect_that_fits_worse_is_ruled_out() -> None:
    judgement, sets = judged((0.998, {"damping": 40.0}), (0.002, {"emf": 40.0}))
    assert stand_ins(judgement, sets, ["damping"], 2.0) == ()


def test_an_unusual_effect_beside_all_causes_does_not_stand_for_one() -> None:
    judgement, sets = judged((0.9, {"damping": 40.0}), (0.1, {"damping": 30.0, "emf": 5.0}))
    assert stand_ins(judgement, sets, ["damping"], 2.0) == ()


def with_trials(
    left: list[float], before: list[float], moved: float = 5.0, small: Set[str] = frozenset()
) -> tuple[Any, Any]:
    """A set of one effect, and what it and the nominal robot leave of each trial."""
    judgement, sets = judged((1.0, {"trim": moved}), small=small)
    first, none = candidate(["trim"]), candidate([])
    first.left, none.left = np.array(left), np.array(before)
    trials = [SimpleNamespace(aligned=SimpleNamespace(trial=SimpleNamespace(name=f"{i}"))) for i in range(3)]
    judge: Any = SimpleNamespace(
        heldout_left=lambda one: one.left, settings=SimpleNamespace(misfit=2.5), loss=None
    )
    judgement.first, judgement.none, judgement.tolerant, judgement.fits = first, none, True, ("trim alone",)
    judgement.trial_set = SimpleNamespace(trials=trials)
    return judgement, replace(sets, judge=judge, candidates=(first,), none=-40.0)


def test_a_trial_that_nothing_fits_does_not_hide_what_explains_the_others() -> None:
    judgement, sets = with_trials([0.5, 0.4, 26.0], [4.0, 3.0, 27.0])
    assert misfit_trials(judgement, sets) == {"2": 26.0}
    found = conclude_sets(judgement, sets, 10)
    assert (found.kind, found.causes) == ("explained", ("trim",))


@pytest.mark.parametrize(("left", "kind"), [([0.5, 0.4, 0.3], "no_gap"), ([0.5, 4.0, 9.0], "unexplained")])
def test_a_gap_that_small_errors_explain_is_none(left: list[float], kind: str) -> None:
    found = conclude_sets(*with_trials(left, [4.0, 3.0, 27.0], small={"trim"}), 10)
    assert (found.kind, found.causes, found.ambiguous_with) == (kind, (), ())


@pytest.mark.parametrize(
    ("own", "kind"),
    [([0.4, 24.0, 7.0], "unexplained"), ([0.4, 1.5, 1.2], "no_gap"), ([0.4, 0.3, 27.0], "no_gap")],
)
def test_what_small_errors_do_to_another_robot_is_not_allowed_for_the_nominal_one(
    own: list[float], kind: str
) -> None:
    judgement, sets = with_trials([0.4, 0.7, 26.0], [0.4, 0.7, 26.0], moved=0.0)
    sets = replace(sets, none=1.0)
    verdict = conclude_sets(judgement, sets, 10)
    assert verdict.kind == "no_gap"
    trial_set = SimpleNamespace(mean_squares=lambda whitened: np.array(whitened))
    itself: Any = SimpleNamespace(trial_set=trial_set, none=SimpleNamespace(whitened=own))
    found = by_own_covariance(verdict, judgement, sets, itself)
    assert (found.kind, found.causes) == (kind, ())
    assert (found.other_probability > 0.5) == (kind == "unexplained")


@pytest.mark.parametrize(
    ("tolerant", "moved", "also"),
    [(False, 0.6, ("play",)), (False, 0.4, ()), (True, 1.1, ("play",)), (True, 0.9, ())],
)
def test_a_certain_effect_that_does_little_may_be_at_work(
    tolerant: bool, moved: float, also: tuple[str, ...]
) -> None:
    judgement, sets = with_trials([0.5, 0.4, 0.3], [4.0, 3.0, 27.0])
    judgement.tolerant = tolerant
    both = SimpleNamespace(**vars(candidate(["trim", "play"])), left=np.array([0.5, 0.4, 0.3]))
    found = conclude_sets(
        judgement, replace(sets, candidates=(both,), changes=({"trim": 9.0, "play": moved},)), 10
    )
    assert (found.causes, found.ambiguous_with) == (("trim",), also)
    assert found.kind == ("ambiguous" if also else "explained")


@pytest.mark.parametrize(
    ("closes", "moved", "kind"), [(True, 0.6, "explained"), (False, 0.6, "no_gap"), (True, 0.4, "no_gap")]
)
def test_a_gap_of_angles_that_a_small_change_closes_is_explained_by_it(
    closes: bool, moved: float, kind: str
) -> None:
    judgement, sets = with_trials([0.5, 0.4, 0.3], [0.9, 0.8, 1.2], moved)
    judgement.tolerant, judgement.fits = False, ()
    found = conclude_sets(judgement, sets, 10, closes_gap=closes)
    assert (found.kind, found.causes) == (kind, () if kind == "no_gap" else ("trim",))


@pytest.mark.parametrize(
    ("none", "kind"), [(-8.0, "explained"), (-6.0, "unexplained"), (-2.0, "unexplained")]
)
def test_no_effect_of_gaits_is_named_that_chance_alone_would_make_look_so_good(
    none: float, kind: str
) -> None:
    """The best of fifty gains six by chance in one case of eight, and eight in one of sixty."""
    judgement, sets = with_trials([0.5, 0.4, 0.3], [4.0, 3.0, 27.0])
    found = conclude_sets(judgement, replace(sets, none=none), 50)
    assert (found.kind, found.causes) == (kind, ("trim",) if kind == "explained" else ())
    assert found.p_value == pytest.approx(min(1.0, 50.0 * math.exp(none)))
    judgement, sets = with_trials([0.5, 0.4, 0.3], [0.6, 0.5, 0.7])
    assert conclude_sets(judgement, replace(sets, none=-2.0), 50).kind == "no_gap"


def test_effects_that_predict_worse_are_blamed_no_more_and_something_else_is_likely() -> None:
    blamed = Verdict("explained", ("trim",), ("play",), 0.04)
    assert blamed.without_causes() == Verdict("unexplained", (), (), 0.5)
    assert Verdict("no_gap").without_causes() == Verdict("no_gap")


@pytest.mark.parametrize(("after", "better"), [((1.0, 2.0, 30.0), True), ((1.0, 3.0, 1.0), False)])
def test_a_set_must_predict_the_held_out_trials_that_it_fits(after: tuple[float, ...], better: bool) -> None:
    """The third trial fits nothing, so it does not count."""
    judgement, sets = with_trials([0.5, 0.4, 26.0], [4.0, 3.0, 27.0])

    def measure(first: object, floor: float, trial: int) -> Any:
        return SimpleNamespace(before=2.0, after=after[trial], floor=floor)

    meter, none = SimpleNamespace(measure=measure), dict[str, Floor]()
    within = {"marker.x": Floor(5.0, None, 0.0, 0.0)}
    assert predicts(judgement, sets, meter, [none] * 3) is better  # type: ignore[arg-type]
    assert predicts(judgement, sets, meter, [within] * 3)  # type: ignore[arg-type]


def test_where_most_trials_do_not_fit_nothing_is_explained() -> None:
    judgement, sets = with_trials([0.5, 26.0, 26.0], [0.6, 27.0, 27.0])
    assert conclude_sets(judgement, sets, 10).kind == "unexplained"


@pytest.mark.parametrize(
    ("none", "kind", "causes"),
    [(-40.0, "ambiguous", ("trim",)), (-12.0, "unexplained", ()), (-0.5, "no_gap", ())],
)
def test_effects_that_each_do_less_than_shows_are_no_proof_of_no_gap(
    none: float, kind: str, causes: tuple[str, ...]
) -> None:
    """Where nothing fits nearly as well as they do, there is nothing to explain; else they may be at work."""
    judgement, sets = with_trials([0.9, 1.1, 1.0], [1.3, 1.8, 1.5], moved=1.5)
    verdict = conclude_sets(judgement, replace(sets, none=none), 10)
    assert (verdict.kind, verdict.causes, verdict.ambiguous_with) == (kind, causes, ())
