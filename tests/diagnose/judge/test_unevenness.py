"""Cycles that differ more than any effect of the library explains: "something else" is the answer."""

from pathlib import Path

import numpy as np
import pytest
from planting import SIGNALS, dataset, recording_of

from gaitopt.blind.disturbances import OUTSIDE, disturbed
from gaitopt.diagnose.diagnosis import DiagnosisRequest, diagnose
from gaitopt.diagnose.judge.unevenness import UNEVEN
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator


@pytest.mark.slow
def test_a_servo_that_limps_is_something_else(arcfold: Problem, tmp_path: Path) -> None:
    """Although an effect of the library may explain a good part of the gap."""
    simulator = Simulator.build(arcfold)
    limping = OUTSIDE["limping_servo"]
    robot = disturbed(simulator, limping, limping.draw(np.random.default_rng(1), 0.9, simulator))
    walk = robot.observe(robot.run(arcfold.baselines["square-2s"], duration=14.0))
    trials = {"limping": ("square-2s", recording_of(walk))}
    folder = dataset(tmp_path / "data", trials, starts_at_gait_time_s=0.0)
    with open_executor("threads", 2) as executor:
        data = load_dataset(folder, arcfold, list(SIGNALS))
        request = DiagnosisRequest(1, ("pad_friction",), next_gait=False)
        found = diagnose(simulator, data, request, executor).found
    assert found is not None
    assert found.unevenness > UNEVEN
    assert found.verdict in ("unexplained", "partly_explained")
    assert found.other_probability > 0.5
