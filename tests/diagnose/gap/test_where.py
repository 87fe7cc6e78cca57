"""Where a gap lies: planted gaps are found where they were planted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.split import COMPONENTS
from gaitopt.diagnose.words import answer, explanation
from gaitopt.effects.active import Values

Diagnosed = Callable[..., Diagnosis]

pytestmark = pytest.mark.slow


def heaviest(diagnosis: Diagnosis) -> str:
    """The component with the largest share over all signals and trials."""
    shares = dict.fromkeys(COMPONENTS, 0.0)
    for row in diagnosis.where:
        shares[row.component] += row.share
    return max(shares, key=lambda name: shares[name])


def test_no_gap_where_there_is_none(diagnosed: Diagnosed) -> None:
    diagnosis = diagnosed()
    assert diagnosis.verdict == "no_gap"
    assert diagnosis.causes == []
    assert diagnosis.gap.before < 2.0 * diagnosis.gap.floor
    assert diagnosis.gap.after == diagnosis.gap.before
    assert answer(diagnosis).startswith("No significant gap")


@pytest.mark.parametrize(
    ("effects", "component"),
    [
        ({"command_latency": {"delay_s": 0.08}}, "timing"),
        ({"servo_travel": {"gain": 0.88}}, "stride"),
        ({"ground_slope": {"angle_rad": 0.08}}, "drift"),
        ({"pad_friction": {"scale": 0.7}}, "drift"),
    ],
)
def test_a_gap_is_found_where_it_was_planted(
    diagnosed: Diagnosed, effects: Mapping[str, Values], component: str
) -> None:
    diagnosis = diagnosed(effects)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.where[0].component == component
    assert heaviest(diagnosis) == component
    assert sum(row.share for row in diagnosis.where) == pytest.approx(1.0)
    assert any(component in sentence for sentence in explanation(diagnosis))


def test_a_gap_that_small_errors_may_make_is_not_called_none(diagnosed: Diagnosed) -> None:
    nothing = {"candidates": (), "causes": (), "best": None, "gap": None, "gap_angles": None}
    found: Any = SimpleNamespace(verdict="no_gap", misfit_trials={"walk": 8.92}, **nothing)
    diagnosis = replace(diagnosed({"servo_travel": {"gain": 0.88}}), found=found)
    assert diagnosis.verdict == "no_gap"
    assert answer(diagnosis).startswith("No effect stands out from the small errors that every robot has.")
    assert explanation(diagnosis)[0].startswith("Trial walk does not fit the others: 8.9 times as much is")
    assert answer(replace(diagnosed(), found=found)).startswith("No significant gap")


def test_the_marker_alone_tells_a_travel_error(diagnosed: Diagnosed) -> None:
    diagnosis = diagnosed({"servo_travel": {"gain": 0.88}}, signals=("marker.x",), sync=False)
    assert diagnosis.where[0].component == "stride"
    for trial in diagnosis.trials:
        assert trial.splits["marker.x"].size == pytest.approx(0.81, abs=0.06)


def test_a_latency_is_measured_where_the_start_is_known(diagnosed: Diagnosed) -> None:
    effects = {"command_latency": {"delay_s": 0.08}}
    for trial in diagnosed(effects).trials:
        assert trial.splits["joint.mid_left"].delay_s == pytest.approx(0.08, abs=0.01)
    unknown = diagnosed(effects, sync=False)
    assert unknown.verdict == "no_gap"
    for trial in unknown.trials:
        assert trial.aligned.offset_s == pytest.approx(-0.08, abs=0.005)


def test_outliers_are_found_under_noise_and_explain_themselves(diagnosed: Diagnosed) -> None:
    def spoil(columns: dict[str, np.ndarray]) -> None:
        flags = np.arange(len(columns["t_s"])) % 19 == 9  # never at one phase of a gait, which is motion
        for name in ("x_m", "y_m", "z_m"):
            columns[name] = np.where(flags, columns[name] + 0.04, columns[name])

    diagnosis = diagnosed(change=spoil)
    assert (diagnosis.verdict, diagnosis.causes) == ("explained", ["marker_outliers"])
    assert diagnosis.where[0].component == heaviest(diagnosis) == "noise"
    assert diagnosis.gap.before > 3.0 * diagnosis.gap.after


def test_rounded_time_stamps_are_found_under_timing_and_explain_themselves(diagnosed: Diagnosed) -> None:
    def spoil(columns: dict[str, np.ndarray]) -> None:
        columns["t_s"] = 0.2 * np.round(columns["t_s"] / 0.2)

    diagnosis = diagnosed(change=spoil)
    assert (diagnosis.verdict, diagnosis.causes) == ("explained", ["clock_rounding"])
    assert heaviest(diagnosis) == "timing"


def test_the_components_squares_are_the_gaps_square(diagnosed: Diagnosed) -> None:
    for trial in diagnosed({"servo_travel": {"gain": 0.88}}).trials:
        for name, part in trial.splits.items():
            assert part.rms == pytest.approx(trial.aligned.rms(name))


def test_a_trial_below_its_floor_blames_nothing(diagnosed: Diagnosed) -> None:
    diagnosis = diagnosed()
    quiet = [trial for trial in diagnosis.trials if not trial.counts]
    assert quiet
    blamed = {row.trial for row in diagnosis.where}
    for trial in quiet:
        assert trial.name not in blamed
        assert any("shows no cause" in s and s.startswith(trial.name) for s in explanation(diagnosis))
