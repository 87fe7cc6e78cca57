"""The corrected and the nominal robot, compared on the same gaits."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gaitopt.diagnose.correction import CorrectionSettings, Walked, correct, walked_gaits
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.problem.problem import Problem

BRIEF = CorrectionSettings(periods_s=(1.0,), gaits=0)


@pytest.fixture
def steep(strider: Problem) -> Problem:
    """The strider that walks uphill."""
    return strider.with_effects({"ground_slope": {"angle_rad": 0.05}})


def test_every_baseline_and_another_period_on_both_robots(strider: Problem, steep: Problem) -> None:
    rows = walked_gaits(strider, steep, SerialExecutor(), BRIEF)
    first = next(iter(strider.baselines))
    assert [row.name for row in rows] == [*strider.baselines, f"{first} at 1 s"]
    assert all(math.isfinite(row.nominal_m_s) and math.isfinite(row.corrected_m_s) for row in rows)
    assert any(row.nominal_m_s != row.corrected_m_s for row in rows)
    assert rows[-1].to_dict()["period_s"] == 1.0


def test_a_search_adds_the_best_gait_of_each_robot(strider: Problem, steep: Problem) -> None:
    rows = walked_gaits(strider, steep, SerialExecutor(), CorrectionSettings(periods_s=(), gaits=4))
    of_nominal, of_corrected = rows[-2:]
    assert of_nominal.name == "best for the nominal robot"
    assert of_nominal.nominal_m_s >= max(row.nominal_m_s for row in rows[:-2]) - 1e-12
    assert of_corrected.corrected_m_s >= max(row.corrected_m_s for row in rows[:-2]) - 1e-12


@pytest.mark.slow
def test_in_processes_the_speeds_are_the_same(strider: Problem, steep: Problem) -> None:
    with open_executor("processes", 2) as executor:
        rows: list[Walked] = walked_gaits(strider, steep, executor, BRIEF)
    assert rows == walked_gaits(strider, steep, SerialExecutor(), BRIEF)


def test_without_a_fitted_effect_there_is_nothing_to_correct(strider: Problem) -> None:
    located = Diagnosis(strider.name, "trials", 1, strider.simulation.working, ())
    assert correct(strider, located) is None


def found_with(
    verdict: str, causes: tuple[str, ...], left: list[float], nominal: float, significant: bool = True
) -> Diagnosis:
    """A diagnosis whose candidates leave so much of held-out angles, rad, the most probable first.

    Its one trial has a significant gap, or none.
    """

    def candidate(rms: float) -> Candidate:
        nothing = np.empty(0)
        return Candidate((), (), nothing, nothing, nothing, marker=nothing, angles=np.full(9, rms))

    candidates = tuple(map(candidate, left))
    found: Any = SimpleNamespace(
        verdict=verdict,
        causes=causes,
        candidates=candidates,
        best=candidates[0] if candidates else None,
        none=candidate(nominal),
    )
    trial: Any = SimpleNamespace(significant=significant, is_misfit=False, blamed=())
    fidelity: Any = None
    return Diagnosis("p", "s", 1, fidelity, (trial,), found=found)


@pytest.mark.parametrize(
    ("verdict", "causes", "left", "corrected"),
    [
        ("unexplained", (), [1.2, 0.9, 0.5], 0.9),
        ("partly_explained", (), [0.9], 0.9),
        ("unexplained", (), [1.0, 1.2], None),
        ("explained", ("servo_lag",), [1.1, 0.5], 1.1),
        ("no_gap", (), [1.2, 0.5], 0.5),
        ("no_gap", (), [1.2], None),
        ("unexplained", (), [], None),
    ],
)
def test_a_robot_is_corrected_wherever_held_out_data_are_predicted_better(
    verdict: str, causes: tuple[str, ...], left: list[float], corrected: float | None
) -> None:
    chosen = found_with(verdict, causes, left, nominal=1.0).correction
    assert (None if chosen is None else chosen.rms_left) == (corrected and pytest.approx(corrected))


def test_nothing_is_corrected_where_the_gap_is_within_its_floor() -> None:
    diagnosis = found_with("no_gap", (), [0.5], nominal=1.0, significant=False)
    assert diagnosis.within_floor
    assert diagnosis.correction is None


def test_a_defect_of_a_record_corrects_no_robot_whose_gap_is_within_its_floor() -> None:
    diagnosis = found_with("no_gap", (), [0.5], nominal=1.0, significant=False)
    defect = SimpleNamespace(name="clock_rounding")
    trial: Any = SimpleNamespace(significant=False, is_misfit=False, blamed=(defect,))
    rounded = replace(diagnosis, trials=(trial,))
    assert rounded.verdict == "explained"
    assert rounded.correction is None
