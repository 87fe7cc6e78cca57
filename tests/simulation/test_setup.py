"""Robots as values: compiled once per process, without delaying others."""

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario, draw_scenarios
from gaitopt.simulation.setup import RobotSetup, prepared


def setup_at(problem: Problem, timestep_s: float) -> RobotSetup:
    fidelity = Fidelity(timestep_s=timestep_s, integrator="Euler")
    return RobotSetup.of(problem, (NOMINAL,), fidelity)


def test_a_setup_is_compiled_once(strider: Problem) -> None:
    setup = setup_at(strider, 1.1e-3)
    with ThreadPoolExecutor(4) as executor:
        simulators = {id(one.simulator) for one in executor.map(prepared, [setup] * 8)}
    assert len(simulators) == 1


def test_a_robot_that_compiles_does_not_hold_up_others(
    strider: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = setup_at(strider, 1.2e-3), setup_at(strider, 1.3e-3)
    compiling, go_on, build = threading.Event(), threading.Event(), Simulator.build

    def patient(problem: Problem, scenarios: Sequence[Scenario], fidelity: Fidelity) -> Simulator:
        if fidelity == slow.fidelity:
            compiling.set()
            assert go_on.wait(60.0)
        return build(problem, scenarios, fidelity)

    monkeypatch.setattr(Simulator, "build", patient)
    with ThreadPoolExecutor(1) as executor:
        waiting = executor.submit(prepared, slow)
        assert compiling.wait(60.0)
        assert prepared(quick).simulator.fidelity == quick.fidelity
        assert not waiting.done()
        go_on.set()
        assert waiting.result().simulator.fidelity == slow.fidelity


def test_the_latest_robots_are_kept(strider: Problem) -> None:
    oldest = prepared(setup_at(strider, 1.4e-3)).simulator
    for index in range(8):
        prepared(setup_at(strider, 1.5e-3 + 1e-5 * index))
    assert prepared(setup_at(strider, 1.57e-3)).simulator is prepared(setup_at(strider, 1.57e-3)).simulator
    assert prepared(setup_at(strider, 1.4e-3)).simulator is not oldest


def test_metrics_know_the_servos_of_each_scenario(arcfold: Problem) -> None:
    """A servo's own damping is no load at its shaft: a tenth more of it must not count as power."""
    scenarios = (NOMINAL, *draw_scenarios(arcfold, 2, [4]))
    setup = RobotSetup.of(arcfold, scenarios, arcfold.simulation.working)
    gait = arcfold.baselines["square-1s"]
    powers = []
    for index in range(len(scenarios)):
        one = prepared(setup, index)
        path = one.simulator.run(gait, one.scenario, duration=3.0)
        powers.append(measure(arcfold, gait, path, one.robot)["power_w"])
    dampings = [prepared(setup, index).robot.damping for index in range(len(scenarios))]
    assert np.ptp(dampings, axis=0).min() > 0.0
    assert powers[1:] == pytest.approx([powers[0]] * 2, rel=0.35)
