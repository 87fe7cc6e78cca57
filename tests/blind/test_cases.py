"""Sealed cases: made, diagnosed without their truth, and scored with it."""

import json
from pathlib import Path

import numpy as np
import pytest

from gaitopt.blind.cases import CaseRequest, kinds_of, make_cases
from gaitopt.blind.disturbances import OUTSIDE, disturbed
from gaitopt.blind.factory import RecordingPlan
from gaitopt.cli.app import main
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator


@pytest.mark.slow
def test_cases_are_diagnosed_without_their_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


@pytest.mark.slow
def test_the_same_seed_makes_the_same_case(tmp_path: Path) -> None:
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
        (["--kind", "outside", "--only", "servo_trim"], "an effect with --kind single"),
        (["--kind", "pair", "--only", "servo_trim"], "an effect with --kind single"),
        (["--kind", "single", "--only", "gusts"], "a disturbance with --kind outside"),
    ],
)
def test_wrong_requests_are_said_in_a_line(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    base = ["blind", "make", "arcfold", "--cases", "1", "--gaits", "square-1s", "--seconds", "3"]
    assert main([*base, "--out", str(tmp_path / "x"), *arguments]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_disturbance_moves_the_robot_otherwise(name: str, arcfold: Problem) -> None:
    simulator = Simulator.build(arcfold)
    figures = OUTSIDE[name].draw(np.random.default_rng(1), 0.9, simulator)
    gait = arcfold.baselines["square-1s"]
    plain = simulator.run(gait, duration=4.0)
    other = disturbed(simulator, OUTSIDE[name], figures).run(gait, duration=4.0)
    assert other.status == "ok"
    assert np.abs(other["marker.x"] - plain["marker.x"]).max() > 1e-3


def test_kinds_are_drawn_in_their_shares() -> None:
    kinds = kinds_of(40, 1)
    assert len(kinds) == 40
    assert {kind: kinds.count(kind) for kind in ("none", "outside", "pair")} == {
        "none": 7,
        "outside": 5,
        "pair": 4,
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["single", "outside", "several"])
def test_a_case_made_in_processes_has_the_same_bytes(kind: str, arcfold: Problem, tmp_path: Path) -> None:
    plan = RecordingPlan(["square-1s"], 2.0)
    for name in ("serial", "processes"):
        with open_executor(name, None if name == "serial" else 2) as executor:
            make_cases(arcfold, tmp_path / name, CaseRequest([kind], 4, plan), executor)
    serial, processes = (
        {str(path.relative_to(tmp_path / name)): path.read_bytes() for path in _files(tmp_path / name)}
        for name in ("serial", "processes")
    )
    assert len(serial) == 5
    assert serial == processes


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())
