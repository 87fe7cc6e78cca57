"""Commands without a period: a trial of a log is read from its file and its gap is located."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import rigs
from drives import Sampled, wandering
from planting import dataset, recording_of

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.diagnosis import Diagnosis, locate
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.drive import Drive
from gaitopt.problem.problem import Problem
from gaitopt.report.film.take import take
from gaitopt.simulation.rollout import Simulator

ROLES = {"marker": "tip", "forward": [1, 0, 0], "hinges": ["elbow"]}
SECONDS = 8.0


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm on one servo, with a log of commands among what can be commanded."""
    problem = rigs.build(tmp_path_factory.mktemp("rig") / "arm", rigs.arm(), ROLES)
    log = cast(Any, wandering(1, SECONDS))  # a data set's file cannot name a log of commands yet
    return replace(problem, baselines={**problem.baselines, "log": log})


@pytest.fixture(scope="module")
def located(arm: Problem, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Diagnosis]:
    """Locate the gap of one trial of the log."""

    def run(
        gap: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None, sync: bool = True
    ) -> Diagnosis:
        robot = Simulator.build(arm)
        trajectory = robot.run(arm.baselines["log"])
        if gap is not None:
            joint = gap(trajectory.time, trajectory["joint.elbow"])
            trajectory = replace(trajectory, signals={**trajectory.signals, "joint.elbow": joint})
        columns = recording_of(trajectory, signals=("marker.x", "marker.z", "joint.elbow"))
        folder = tmp_path_factory.mktemp("log") / "dataset"
        dataset(folder, {"log": ("log", columns)}, **({"starts_at_gait_time_s": 0.0} if sync else {}))
        known = [name for name in robot.signals if name]
        with ThreadPoolExecutor(1) as executor:
            return locate(robot, load_dataset(folder, arm, known), executor, 1)

    return run


def test_commands_without_a_period_are_simulated_for_as_long_as_they_last(arm: Problem) -> None:
    drive: Drive = wandering(1, SECONDS)
    assert isinstance(drive, Drive)
    robot = Simulator.build(arm)
    assert robot.duration(drive) == SECONDS
    trajectory = robot.run(drive)
    assert trajectory.status == "ok"
    assert trajectory.time[-1] == pytest.approx(SECONDS)
    np.testing.assert_array_equal(trajectory.stacked("target"), drive.targets(trajectory.time))
    assert np.ptp(trajectory["joint.elbow"]) > 0.3


def test_a_right_model_of_a_log_has_no_gap(located: Callable[..., Diagnosis]) -> None:
    diagnosis = located()
    assert diagnosis.verdict == "no_gap"
    assert [defect.name for trial in diagnosis.trials for defect in trial.defects] == []


def test_an_unknown_start_of_a_log_is_fitted(located: Callable[..., Diagnosis]) -> None:
    (trial,) = located(sync=False).trials
    assert trial.aligned.offset_s == pytest.approx(0.0, abs=0.005)


def test_a_late_log_is_found_under_lag(located: Callable[..., Diagnosis]) -> None:
    diagnosis = located(lambda time, joint: np.interp(time - 0.08, time, joint))
    assert (diagnosis.where[0].signal, diagnosis.where[0].component) == ("joint.elbow", "lag")
    assert diagnosis.trials[0].splits["joint.elbow"].delay_s == pytest.approx(0.08, abs=0.01)


def test_a_weaker_motion_of_a_log_is_found_under_gain(located: Callable[..., Diagnosis]) -> None:
    diagnosis = located(lambda time, joint: joint.mean() + 0.8 * (joint - joint.mean()))
    assert (diagnosis.where[0].signal, diagnosis.where[0].component) == ("joint.elbow", "gain")
    assert diagnosis.trials[0].splits["joint.elbow"].size == pytest.approx(0.8, abs=0.02)


def test_figures_of_cycles_are_left_out_without_a_period(located: Callable[..., Diagnosis]) -> None:
    content = json.loads(json.dumps(located().to_dict()))
    (trial,) = content["trials"]
    assert (trial["gait"], trial["period_s"]) == ("log", None)
    for signal in trial["signals"]:
        assert signal["floor_parts"]["spread"] is None
        assert signal["travel_measured"] is None
        assert signal["by_phase"] == []


def test_a_log_is_filmed_without_a_period(arm: Problem) -> None:
    shown = take(Simulator.build(arm), wandering(1, SECONDS))
    assert (shown.name, shown.period_s, shown.block_s) == ("log", None, 0.5)
    assert np.isnan(shown.speed_m_s)


def test_a_trial_of_fewer_samples_than_a_block_needs_is_refused(arm: Problem, tmp_path: Path) -> None:
    time = np.arange(0.0, 0.05, 0.02)
    dataset(tmp_path, {"log": ("log", {"t_s": time, "elbow_rad": np.sin(time)})})
    with pytest.raises(GaitoptError, match=r"found 3 samples; allowed: 4 or more"):
        load_dataset(tmp_path, arm, ["joint.elbow"])


def test_two_trials_of_one_log_share_a_prediction(arm: Problem, tmp_path: Path) -> None:
    time = np.arange(0.0, 4.0, 0.02)
    columns = {"t_s": time, "elbow_rad": np.sin(time)}
    dataset(tmp_path, {"one": ("log", columns), "two": ("log", columns)})
    trials = load_dataset(tmp_path, arm, ["joint.elbow"]).trials
    other = Sampled(trials[0].drive.time, trials[0].drive.rows + 0.1)  # type: ignore[attr-defined]
    with ThreadPoolExecutor(1) as executor:
        first, second, third = predict(
            Simulator.build(arm), [*trials, replace(trials[0], drive=other)], executor
        )
    assert first is second
    assert third is not first
