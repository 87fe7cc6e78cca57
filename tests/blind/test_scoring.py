"""The record of diagnoses on sealed cases: its counts are right."""

from collections.abc import Sequence

from gaitopt.blind.answers import Answer, AnsweredEffect, AnsweredGap, Case, FittedParameter
from gaitopt.blind.scoring import Estimate, mean, rate, score, sentences
from gaitopt.blind.sealed import PlantedEffect, Truth


def case(
    kind: str,
    planted: Sequence[str],
    verdict: str,
    causes: Sequence[str],
    others: Sequence[str] = (),
    gap: float = 10.0,
    alike: float = 0.5,
) -> Case:
    """A case whose planted effects have scale 1.15, and whose diagnosis says 1.0 to 1.2."""
    effects = tuple(
        AnsweredEffect(
            name=name,
            target="all",
            probability=0.5,
            parameters={"scale": FittedParameter(value=1.1, ci90=(1.0, 1.2))},
            heldout_shrinkage=0.9,
            alike=alike,
        )
        for name in [*causes, *others]
    )
    rows = tuple(PlantedEffect(name=name, target="all", parameters={"scale": 1.15}) for name in planted)
    answer = Answer(
        verdict=verdict,
        causes=tuple(causes),
        ambiguous_with=tuple(others),
        effects=effects,
        other_probability=0.1,
        gap=AnsweredGap(shrinkage=0.9),
    )
    truth = Truth(kind=kind, effects=rows, gap_over_floor=gap)
    return Case(name="case", truth=truth, diagnosis=answer)


def test_the_score_counts_what_it_says() -> None:
    record = score(
        [
            case("single", ["a"], "explained", ["a"]),
            case("single", ["a"], "ambiguous", ["b"], ["a"]),
            case("single", ["a"], "ambiguous", ["b"], ["a"], alike=0.999),
            case("single", ["a"], "explained", ["b"]),
            case("single", ["a"], "explained", ["b"], gap=2.0),
            case("none", [], "no_gap", [], gap=0.0),
            case("outside", ["z"], "unexplained", []),
            case("pair", ["a", "b"], "explained", ["a", "b"]),
        ]
    )
    assert record.top_right.value == 0.5  # a tie counts as right
    assert record.truth_in_set.value == 0.75
    assert record.mean_set_size.value == 1.5
    assert record.false_cause.value == 0.0
    assert record.outside_recognised.value == record.pair_both.value == 1.0
    assert record.coverage.value == 1.0
    assert record.small_gaps == 1
    assert record.to_dict()["coverage"] == {"value": 1.0, "ci90": list(record.coverage.ci90), "cases": 2}
    assert any("top cause right: 50%" in sentence for sentence in sentences(record))


def test_one_of_two_causes_is_no_tie() -> None:
    record = score([case("single", ["a"], "explained", ["b", "a"], alike=1.0)])
    assert (record.top_right.value, record.truth_in_set.value) == (0.0, 1.0)


def test_a_rate_of_nothing_is_nothing() -> None:
    assert rate([], lambda c: True) == Estimate(None, (None, None), 0)


def test_the_interval_of_a_rate_reaches_a_rate_of_0_or_1() -> None:
    for count in range(1, 100):
        same = [case("none", [], "no_gap", [])] * count
        assert rate(same, lambda c: True).ci90[1] == 1.0
        assert rate(same, lambda c: False).ci90[0] == 0.0


def test_a_mean_lies_inside_its_interval() -> None:
    assert mean([]) == Estimate(None, (None, None), 0)
    assert mean([2.0]) == Estimate(2.0, (2.0, 2.0), 1)
    found = mean([1.0, 2.0, 3.0, 4.0])
    low, high = found.ci90
    assert low is not None
    assert high is not None
    assert 1.0 < low < 2.5 < high < 4.0
