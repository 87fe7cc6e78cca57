"""Causes planted with other numerics are found with their parameters, and the same every time."""

import importlib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from helpers import blas_threads
from planting import dataset, recording_of, rollout
from threadpoolctl import threadpool_limits

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import seeded
from gaitopt.diagnose.diagnosis import DiagnosisRequest, diagnose
from gaitopt.diagnose.judge.unevenness import UNEVEN
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.effects.active import Values
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.tolerances import NO_ERRORS, SmallErrors, draw_errors

AMONG = ("servo_torque_limit", "ground_slope", "camera_scale")


@pytest.fixture(scope="module")
def simulator(arcfold: Problem) -> Simulator:
    return Simulator.build(arcfold)


def diagnosed(
    simulator: Simulator,
    folder: Path,
    effects: Mapping[str, Values],
    among: Collection[str] = AMONG,
    workers: int = 2,
    known: bool = True,
    gaits: Sequence[str] = ("square-2s", "square-1s"),
    errors: SmallErrors = NO_ERRORS,
    seconds: float = 5.0,
) -> dict[str, Any]:
    trials = {
        gait: (gait, recording_of(rollout(simulator.problem, gait, seconds, effects, errors)))
        for gait in gaits
    }
    start = {"starts_at_gait_time_s": 0.0} if known else {}
    data = load_dataset(
        dataset(folder, trials, **start), simulator.problem, [s for s in simulator.signals if s]
    )
    with open_executor("threads", workers) as executor:
        found = diagnose(simulator, data, DiagnosisRequest(1, among, next_gait=False), executor)
    return found.to_dict()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "target", "value", "within"),
    [
        ("servo_torque_limit", "mid_act", 0.17, 0.02),
        ("camera_scale", None, 1.08, 0.02),
    ],
)
def test_a_planted_cause_is_found_with_its_parameter(
    simulator: Simulator, tmp_path: Path, name: str, target: str | None, value: float, within: float
) -> None:
    parameter = {"servo_torque_limit": "limit_n_m"}.get(name, "scale")
    planted = {parameter: value} | ({"target": target} if target else {})
    found = diagnosed(simulator, tmp_path, {name: planted})
    assert found["causes"][0] == name
    assert found["verdict"] in ("explained", "ambiguous")
    row = found["effects"][0]
    assert row["name"] == name
    assert target is None or row["target"] == target
    assert row["parameters"][parameter]["value"] == pytest.approx(value, abs=within)
    low, high = row["parameters"][parameter]["ci90"]
    assert low <= row["parameters"][parameter]["value"] <= high
    gap = found["gap"]
    assert gap["heldout_after_m"] < gap["heldout_before_m"]
    assert found["unevenness"] < UNEVEN


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "seconds"), [(1, 5.0), (2, 5.0), (1, 4.0)])
def test_two_effects_are_found_on_a_robot_that_is_a_little_wrong_in_everything(
    simulator: Simulator, tmp_path: Path, seed: int, seconds: float
) -> None:
    """Of the shortest recordings the beginnings are hardly shorter, and are not taken alone."""
    tolerances = simulator.problem.file.tolerances
    errors = draw_errors(simulator.effects.nominal, tolerances, seeded(seed))
    planted: dict[str, Values] = {
        "servo_speed_limit": {"limit_rad_s": 1.3, "target": "foot2"},
        "servo_trim": {"offset_rad": 0.17, "target": "foot1"},
    }
    among = (*planted, "body_friction", "pad_friction", "ground_slope")
    found = diagnosed(simulator, tmp_path, planted, among, errors=errors, seconds=seconds)
    assert set(planted) <= {*found["causes"], *found["ambiguous_with"]}
    assert set(found["causes"]) <= set(planted)
    assert found["gap"]["heldout_after_m"] < found["gap"]["heldout_before_m"]


@pytest.mark.slow
def test_two_effects_within_the_tolerances_are_found_on_a_robot_without_other_errors(
    simulator: Simulator, tmp_path: Path
) -> None:
    planted: dict[str, Values] = {
        "servo_trim": {"offset_rad": -0.045, "target": "mid_act"},
        "hinge_friction": {"torque_n_m": 0.007},
    }
    among = (*planted, "body_friction", "pad_friction", "ground_slope", "command_latency")
    found = diagnosed(simulator, tmp_path, planted, among)
    assert set(found["causes"]) == set(planted)
    assert found["verdict"] == "explained"
    values = {row["name"]: row["parameters"] for row in found["effects"]}
    assert values["servo_trim"]["offset_rad"]["value"] == pytest.approx(-0.045, abs=0.005)
    assert values["hinge_friction"]["torque_n_m"]["value"] == pytest.approx(0.007, abs=0.002)


@pytest.mark.slow
def test_small_errors_of_everything_are_not_blamed_on_an_effect(simulator: Simulator, tmp_path: Path) -> None:
    tolerances = simulator.problem.file.tolerances
    errors = draw_errors(simulator.effects.nominal, tolerances, seeded(3))
    among = ("servo_trim", "servo_speed_limit", "body_friction", "pad_friction", "ground_slope")
    assert diagnosed(simulator, tmp_path, {}, among, errors=errors)["causes"] == []


@pytest.mark.slow
def test_a_right_model_has_no_gap(simulator: Simulator, tmp_path: Path) -> None:
    found = diagnosed(simulator, tmp_path, {})
    assert (found["verdict"], found["causes"], found["effects"]) == ("no_gap", [], [])


@pytest.mark.slow
def test_what_is_not_tried_is_not_found(simulator: Simulator, tmp_path: Path) -> None:
    planted: dict[str, Values] = {"servo_torque_limit": {"limit_n_m": 0.1, "target": "mid_act"}}
    found = diagnosed(simulator, tmp_path, planted, ("camera_tilt", "clock_rate"), gaits=("square-1s",))
    assert found["verdict"] in ("unexplained", "partly_explained")
    assert found["other_probability"] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.08, 0.0114])
def test_late_commands_and_a_late_clock_are_one_answer(
    simulator: Simulator, tmp_path: Path, delay: float
) -> None:
    """Even a short delay: the clock's range is five times as wide, and is searched as finely."""
    planted = {"command_latency": {"delay_s": delay}}
    among = ("command_latency", "clock_offset", "servo_gain")
    found = diagnosed(simulator, tmp_path, planted, among, gaits=("square-1s",))
    assert {*found["causes"], *found["ambiguous_with"]} == {"command_latency", "clock_offset"}
    assert found["verdict"] == "ambiguous"
    rows = {row["name"]: row["parameters"] for row in found["effects"]}
    assert rows["clock_offset"]["offset_s"]["value"] == pytest.approx(-delay, abs=3e-4)
    assert rows["command_latency"]["delay_s"]["value"] == pytest.approx(delay, abs=3e-4)


@pytest.mark.slow
def test_the_same_bits_whatever_the_workers_and_cores(simulator: Simulator, tmp_path: Path) -> None:
    planted = {"ground_slope": {"angle_rad": 0.06}}
    among = ("ground_slope", "camera_tilt")
    found = []
    for n in (1, 2):
        with threadpool_limits(limits=n, user_api="blas"):  # as many as there are cores, by default
            one = diagnosed(simulator, tmp_path / str(n), planted, among, n, False, ("square-1s",))
        one.pop("dataset")
        found.append(one)
    assert found[0] == found[1]


def test_its_linear_algebra_runs_on_one_thread(
    simulator: Simulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: set[int] = set()

    def look(*_: object) -> None:
        seen.update(blas_threads())
        raise GaitoptError("seen")

    monkeypatch.setattr(importlib.import_module(diagnose.__module__), "locate", look)
    with threadpool_limits(limits=2, user_api="blas"), pytest.raises(GaitoptError, match="seen"):
        diagnosed(simulator, tmp_path, {})
    assert seen == {1}


def test_nothing_to_try_is_said(simulator: Simulator, tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match="no effect can be tried"):
        diagnosed(simulator, tmp_path, {"ground_slope": {"angle_rad": 0.06}}, among=())
