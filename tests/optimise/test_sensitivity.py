"""Sensitivities: how the speed of a gait changes with each number."""

import math

import numpy as np
import pytest

from gaitopt.core.streams import Stream
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.sensitivity import SensitivitySettings, sensitivities
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator


@pytest.mark.slow
def test_sensitivities_are_paired_differences_over_common_scenarios(strider: Problem) -> None:
    gait = strider.baselines["stride"]
    found = {(one.kind, one.name): one for one in sensitivities(strider, gait, 1, SerialExecutor())}
    variables = [variable.name for variable in strider.space.variables]
    assert [name for kind, name in found if kind == "gait"] == variables
    assert {name for kind, name in found if kind == "model"} == set(strider.file.parameters)
    scenarios = scenarios_of(strider, 1, Stream.SENSITIVITY_SCENARIOS)

    def speeds(factor: float) -> np.ndarray:
        problem = strider.with_parameters({"k_servo": factor * strider.file.parameters["k_servo"].value})
        simulator = Simulator.build(problem, scenarios)
        robot = Robot.of(simulator.models[0])
        runs = [simulator.run(gait, i) for i in range(len(scenarios))]
        return np.array([measure(problem, gait, run, robot)["speed_m_s"] for run in runs])

    step = SensitivitySettings.model_step
    nominal, down, up = (speeds(1.0 + move) for move in (0.0, -step, step))
    one = found["model", "k_servo"]
    assert one.down == pytest.approx((down - nominal).mean(), abs=1e-12)
    assert one.up == pytest.approx((up - nominal).mean(), abs=1e-12)
    assert one.slope == pytest.approx((one.up - one.down) / 2.0, abs=1e-12)
    spread = ((up - down) / 2.0).std(ddof=1) / math.sqrt(len(nominal))
    assert one.noise == pytest.approx(1.894579 * spread, rel=1e-5)
    assert any(abs(one.slope) > one.noise for one in found.values())


@pytest.mark.slow
def test_a_gaits_number_at_its_bound_moves_one_way_only(strider: Problem) -> None:
    point = strider.space.encode(strider.baselines["stride"])
    index = [variable.name for variable in strider.space.variables].index("rear.smoothing")
    point[index] = 0.0
    gait = strider.space.decode(point)
    found = {one.name: one for one in sensitivities(strider, gait, 1, SerialExecutor())}
    assert found["rear.smoothing"].down == pytest.approx(0.0, abs=1e-6)
    assert SensitivitySettings.gait_step < 0.5
