"""The summary: ratios, failed gaits, and its file."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from helpers import still

from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.optimise.run import Optimised, Request
from gaitopt.optimise.verification import Verified
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import ProblemFile
from gaitopt.runs.summary import MeasuredRow, Summary
from gaitopt.simulation.objective import Evaluation


def verified(problem: Problem, name: str, speeds: list[float], met: bool = True) -> Verified:
    """A gait as if it had been verified."""
    metrics = {"speed_m_s": float(np.mean(speeds))}
    status = "ok" if np.isfinite(speeds).all() else "diverged: badqacc"
    evaluation = Evaluation(0.0, metrics, {"airtime": 0.0 if met else 2.0}, status)
    gait = still(problem)
    return Verified(type(gait)(2.0, gait.channels, name), evaluation, np.array(speeds), 1.0)


def compared(problem: Problem, best: Verified, *baselines: Verified) -> Summary:
    """The summary of a run with these results."""
    optimised = Optimised(
        request=Request(),
        entries=[],
        plan=None,
        warm_start=None,
        rank_correlation=None,
        notes=(),
        found_by="cma-es",
        best=best,
        baselines=list(baselines),
        simulated_s=7.0,
        wall_s=1.0,
    )
    return Summary.of(problem, optimised)


def test_ratios_are_to_the_fastest_and_to_the_fastest_that_meets_the_constraints(strider: Problem) -> None:
    found = compared(
        strider,
        verified(strider, "best", [0.3, 0.5]),
        verified(strider, "slow", [0.1, 0.1]),
        verified(strider, "fast", [0.2, 0.2], met=False),
    )
    assert found.ratio_to_best_baseline == pytest.approx(2.0)
    assert found.ratio_to_best_feasible_baseline == pytest.approx(4.0)
    assert [row.constraints_met for row in found.baselines] == [True, False]
    assert found.baselines[0].stride_m == pytest.approx(0.2)
    assert found.best.speed_m_s == found.verified.speed_m_s == pytest.approx(0.4)
    assert found.verified.timestep_s == strider.simulation.reference.timestep_s


@pytest.mark.parametrize("order", [1, -1])
def test_a_failed_baseline_does_not_hide_the_others(strider: Problem, order: int) -> None:
    baselines = [verified(strider, "lost", [math.nan, 0.1]), verified(strider, "good", [0.2, 0.2])][::order]
    found = compared(strider, verified(strider, "best", [0.4, 0.4]), *baselines)
    assert found.ratio_to_best_baseline == pytest.approx(2.0)


def test_there_is_no_ratio_to_a_gait_that_does_not_go_forward(strider: Problem) -> None:
    found = compared(strider, verified(strider, "best", [0.4, 0.4]), verified(strider, "back", [-0.1, -0.1]))
    assert found.ratio_to_best_baseline is None


def test_what_was_measured_comes_from_the_problem_and_its_baselines(strider: Problem) -> None:
    table = {"square": {"speed_m_s": 0.15, "origin": "filmed"}}
    real = strider._with(ProblemFile.model_validate(strider.to_dict() | {"measured": table}))
    best, square = verified(strider, "best", [0.3, 0.5]), verified(strider, "square", [0.1, 0.1])
    square.evaluation.metrics["rms_torque_n_m"] = 0.2
    found = compared(real, best, square, verified(strider, "stride", [0.2, 0.2]))
    assert found.measured == MeasuredRow(
        gaits=("square",), period_s=(2.0, 2.0), speed_m_s=(0.15, 0.15), rms_torque_n_m=0.2
    )
    assert found.to_dict()["measured"]["speed_m_s"] == [0.15, 0.15]
    assert "measured" not in compared(strider, best, square).to_dict()


def test_the_file_read_back_is_the_same_record(strider: Problem, tmp_path: Path) -> None:
    found = compared(strider, verified(strider, "best", [0.3, 0.5]), verified(strider, "slow", [0.1, 0.1]))
    path = tmp_path / "summary.json"
    path.write_text(to_json(found.to_dict()))
    assert Summary.read(path) == found
    assert found.fastest_baseline == found.baselines[0]


def test_what_is_not_finite_is_null_in_the_file_and_nan_in_the_record(
    strider: Problem, tmp_path: Path
) -> None:
    found = compared(strider, verified(strider, "best", [math.nan, 0.5]), verified(strider, "slow", [0.1]))
    path = tmp_path / "summary.json"
    path.write_text(to_json(found.to_dict()))
    content = json.loads(path.read_text())
    assert content["best"]["speed_m_s"] is None
    assert content["best"]["speed_ci90_m_s"] == [None, None]
    back = Summary.read(path)
    assert math.isnan(back.best.speed_m_s)
    assert to_json(back.to_dict()) == path.read_text()


def test_a_summary_of_an_earlier_version_keeps_the_keys_that_it_has(tmp_path: Path) -> None:
    """The figures that are printed of a finished run are required, and no others."""
    row = {"name": "best", "period_s": 0.5, "speed_m_s": 0.1, "speed_ci90_m_s": [0.0, 0.2]}
    row |= {"constraints_met": True, "violations": {}, "status": "ok"}
    path = tmp_path / "summary.json"
    path.write_text(to_json({"baselines": [], "best": row, "ratio_to_best_baseline": None}))
    back = Summary.read(path)
    assert to_json(back.to_dict()) == path.read_text()
    assert back.fastest_baseline is None
    path.write_text(to_json({"baselines": [], "best": row}))
    with pytest.raises(GaitoptError, match=r"summary\.json: ratio_to_best_baseline: missing; it is required"):
        Summary.read(path)


def test_keys_are_those_of_the_file_format(strider: Problem) -> None:
    """In the order that they have always had in the file."""
    found = compared(strider, verified(strider, "best", [0.3, 0.5]), verified(strider, "slow", [0.1, 0.1]))
    assert list(found.to_dict()) == [
        "problem", "seed", "budget", "method", "evaluations", "simulated_s", "wall_s", "baselines",
        "warm_start", "over_scenarios", "fidelity_ladder", "pareto", "notes", "best", "verified",
        "ratio_to_best_baseline", "ratio_to_best_feasible_baseline",
    ]  # fmt: skip
    row = [
        "name", "period_s", "speed_m_s", "speed_ci90_m_s", "speed_worst_m_s", "stride_m", "constraints_met",
        "violations", "status", "metrics",
    ]  # fmt: skip
    content = found.to_dict()
    assert list(content["baselines"][0]) == row
    assert list(content["best"]) == [*row, "found_by", "margins", "findings", "warnings"]
    assert list(content["verified"]) == ["timestep_s", "integrator", "scenarios", "speed_m_s"]
