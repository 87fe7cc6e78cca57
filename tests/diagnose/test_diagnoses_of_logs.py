"""Diagnoses of logged commands: in words, as records, and the defects that they show."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from benches import SIGNAL, Change, bench, located, write_bench

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.split_commands import COMMAND_COMPONENTS
from gaitopt.diagnose.gap.where import by_component
from gaitopt.diagnose.words import answer, explanation
from gaitopt.problem.problem import Problem


def raised(time: np.ndarray, response: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """From soon after the start on, the angle is 0.05 rad too large."""
    return response(time) + 0.05 * np.minimum(time / 0.05, 1.0)


Located = Callable[..., Diagnosis]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """The made bench."""
    return bench(tmp_path_factory.mktemp("bench") / "arm")


@pytest.fixture(scope="module")
def diagnosed(arm: Problem, tmp_path_factory: pytest.TempPathFactory) -> Located:
    """Locate the gap of a made data set."""

    def run(change: Change | None = None, **more: object) -> Diagnosis:
        return located(arm, write_bench(tmp_path_factory.mktemp("data"), arm, change, **more))  # type: ignore[arg-type]

    return run


def test_a_right_model_of_a_bench_has_no_gap(diagnosed: Located) -> None:
    diagnosis = diagnosed()
    assert diagnosis.verdict == "no_gap"
    assert not diagnosis.measures_positions
    gap = diagnosis.gap_angles
    assert gap is not None
    assert gap.before == gap.after < 2.0 * gap.floor
    assert answer(diagnosis).startswith("No significant gap: ")
    assert "RMS of the angles" in answer(diagnosis)


def test_angles_are_reported_apart_in_rad(diagnosed: Located) -> None:
    content = json.loads(json.dumps(diagnosed(raised).to_dict()))
    angles = content["gap_angles"]
    assert list(angles) == [
        "heldout_before_rad",
        "heldout_after_rad",
        "floor_rad",
        "shrinkage",
        "shrinkage_ci90",
    ]
    assert angles["heldout_before_rad"] == angles["heldout_after_rad"] == pytest.approx(0.05, rel=0.05)
    assert angles["shrinkage"] == 0.0
    for row in content["where"]:
        assert row["unit"] == "rad"
        assert row["component"] in COMMAND_COMPONENTS


@pytest.mark.parametrize(
    ("component", "change", "said"),
    [
        ("gain", lambda time, response: 0.7 * response(time), "0.70 times as far"),
        ("bias", raised, "beside the simulated one"),
        ("lag", lambda time, response: response(time - 0.06), "ms later than simulated"),
    ],
)
def test_what_a_servo_does_wrong_is_said(
    diagnosed: Located, component: str, change: Change, said: str
) -> None:
    diagnosis = diagnosed(change)
    assert diagnosis.verdict == "unexplained"
    first, *_ = by_component(diagnosis.where)
    assert (first.signal, first.component) == (SIGNAL, component)
    assert first.share > 0.6
    assert f"{component} of {SIGNAL} over all trials" in answer(diagnosis)
    assert any(said in sentence for sentence in explanation(diagnosis))


def test_shares_by_component_add_up(diagnosed: Located) -> None:
    diagnosis = diagnosed(lambda time, response: 0.9 * response(time - 0.03) + 0.01)
    rows = by_component(diagnosis.where)
    assert sum(row.share for row in rows) == pytest.approx(1.0)
    pooled = math.sqrt(sum(row.gap**2 for row in rows))
    each = [part.rms**2 for trial in diagnosis.trials if trial.counts for part in trial.splits.values()]
    assert pooled == pytest.approx(math.sqrt(np.mean(each)))


def test_each_trial_is_said_in_its_own_words(diagnosed: Located) -> None:
    sentences = explanation(diagnosed(raised))
    (ramp,) = (s for s in sentences if s.startswith("ramp-1: "))
    assert "ramp-1: joint.elbow is 0.0494 rad (2.83°) RMS off" in ramp
    assert "times its floor" in ramp
    assert "repeats of other commands that differ" in ramp or "measurement noise" in ramp


def test_a_fitted_offset_of_the_clocks_is_said(diagnosed: Located) -> None:
    diagnosis = diagnosed(None, trials={"square": 2}, starts_at_gait_time_s="unknown")
    for trial in diagnosis.trials:
        assert trial.aligned.offset_s == pytest.approx(0.0, abs=0.01)
    assert "after the log (fitted)" in explanation(diagnosis)[0]


def test_angles_in_degrees_that_are_said_to_be_in_rad_are_seen(diagnosed: Located) -> None:
    diagnosis = diagnosed(lambda time, response: np.rad2deg(response(time)), trials={"square": 1})
    (defect,) = diagnosis.trials[0].defects
    assert (defect.name, defect.parameters["ratio"]) == ("wrong_unit", pytest.approx(57.3, rel=0.05))
    assert "it may be in degrees" in defect.message


def test_an_angle_that_counts_the_other_way_is_seen(diagnosed: Located) -> None:
    diagnosis = diagnosed(
        lambda time, response: 2.0 * response(time[:1]) - response(time), trials={"ramp": 1}
    )
    (defect,) = diagnosis.trials[0].defects
    assert defect.name == "axis_reversed"
    assert "count the other way" in defect.message
