"""Sealed cases: made, diagnosed without their truth, and scored with it."""

import json

import numpy as np
import pytest

from gaitopt.blind.cases import kinds_of
from gaitopt.blind.disturbances import OUTSIDE, disturbed
from gaitopt.blind.scoring import Case, rate, score, sentences
from gaitopt.cli.app import main
from gaitopt.simulation.rollout import Simulator


def test_cases_are_diagnosed_without_their_truth(tmp_path, capsys):
    cases, hidden = tmp_path / "cases", tmp_path / "hidden"
    make = ["blind", "make", "arcfold", "--cases", "1", "--kind", "none", "--seconds", "4", "--seed", "3"]
    assert main([*make, "--gaits", "square-1s", "--out", str(cases)]) == 0
    truth = json.loads((cases / "sealed" / "case-000.json").read_text())
    assert (truth["kind"], truth["effects"]) == ("none", [])
    (cases / "sealed").rename(hidden)
    out = cases / "diagnoses" / "case-000"
    assert main(["diagnose", "arcfold", str(cases / "case-000"), "--out", str(out)]) == 0
    hidden.rename(cases / "sealed")
    capsys.readouterr()
    assert main(["blind", "score", str(cases), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["cases"] == 1
    assert record["false_cause"] == {"value": 0.0, "ci90": [0.0, pytest.approx(0.73, abs=0.01)], "cases": 1}


def test_the_same_seed_makes_the_same_case(tmp_path):
    for name in ("a", "b"):
        make = ["blind", "make", "arcfold", "--cases", "1", "--kind", "single", "--only", "servo_trim"]
        more = ["--gaits", "square-1s", "--seconds", "3", "--out", str(tmp_path / name)]
        assert main([*make, *more]) == 0
    for file in ("case-000/square-1s.csv", "case-000/dataset.toml", "sealed/case-000.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    truth = json.loads((tmp_path / "a" / "sealed" / "case-000.json").read_text())
    assert truth["effects"][0]["name"] == "servo_trim"
    assert 3.0 <= truth["gap_over_floor"] <= 30.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--gaits", "square-9s"], "unknown gait"),
        (["--signals", "marker.w"], "unknown signal"),
        (["--kind", "single", "--only", "servo_trum"], "servo_trim"),
        (["--only", "servo_trim"], "--kind"),
    ],
)
def test_wrong_requests_are_said_in_a_line(arguments, said, tmp_path, capsys):
    base = ["blind", "make", "arcfold", "--cases", "1", "--gaits", "square-1s", "--seconds", "3"]
    assert main([*base, "--out", str(tmp_path / "x"), *arguments]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_disturbance_moves_the_robot_otherwise(name, arcfold):
    simulator = Simulator.build(arcfold)
    figures = OUTSIDE[name].draw(np.random.default_rng(1), 0.9, simulator)
    gait = arcfold.baselines["square-1s"]
    plain = simulator.run(gait, duration=4.0)
    other = disturbed(simulator, OUTSIDE[name], figures).run(gait, duration=4.0)
    assert other.status == "ok"
    assert np.abs(other["marker.x"] - plain["marker.x"]).max() > 1e-3


def test_kinds_are_drawn_in_their_shares():
    kinds = kinds_of(40, 1)
    assert len(kinds) == 40
    assert {kind: kinds.count(kind) for kind in ("none", "outside", "pair")} == {
        "none": 7,
        "outside": 5,
        "pair": 4,
    }


def case(kind, planted, verdict, causes, others=(), gap=10.0, alike=0.5):
    effects = [
        {
            "name": name,
            "target": "all",
            "probability": 0.5,
            "parameters": {"scale": {"value": 1.1, "ci90": [1.0, 1.2]}},
            "heldout_shrinkage": 0.9,
            "alike": alike,
        }
        for name in [*causes, *others]
    ]
    rows = [{"name": name, "target": "all", "parameters": {"scale": 1.15}} for name in planted]
    return Case(
        "case",
        {"kind": kind, "effects": rows, "gap_over_floor": gap},
        {
            "verdict": verdict,
            "causes": causes,
            "ambiguous_with": list(others),
            "effects": effects,
            "other_probability": 0.1,
            "gap": {"shrinkage": 0.9},
        },
    )


def test_the_score_counts_what_it_says():
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
    assert record["top_right"]["value"] == 0.5  # a tie counts as right
    assert record["truth_in_set"]["value"] == 0.75
    assert record["mean_set_size"]["value"] == 1.5
    assert record["false_cause"]["value"] == 0.0
    assert record["outside_recognised"]["value"] == record["pair_both"]["value"] == 1.0
    assert record["coverage"]["value"] == 1.0
    assert record["small_gaps"] == 1
    assert any("top cause right: 50%" in sentence for sentence in sentences(record))


def test_one_of_two_causes_is_no_tie():
    record = score([case("single", ["a"], "explained", ["b", "a"], alike=1.0)])
    assert (record["top_right"]["value"], record["truth_in_set"]["value"]) == (0.0, 1.0)


def test_a_rate_of_nothing_is_nothing():
    assert rate([], lambda c: True) == {"value": None, "ci90": [None, None], "cases": 0}


def test_the_interval_of_a_rate_reaches_a_rate_of_0_or_1():
    for count in range(1, 100):
        same = [case("none", [], "no_gap", [])] * count
        assert rate(same, lambda c: True)["ci90"][1] == 1.0
        assert rate(same, lambda c: False)["ci90"][0] == 0.0
