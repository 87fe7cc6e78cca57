"""Robots as values: everything that a worker, here or on another machine, needs to simulate one."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Sequence
from dataclasses import dataclass

from gaitopt.core.errors import GaitoptError
from gaitopt.core.versions import versions_text
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

_KEPT = 8
"""Compiled robots that a worker keeps, the latest ones."""


@dataclass(frozen=True)
class RobotSetup:
    """What a gait is evaluated in: the robot, the scenarios, the fidelity.

    It is a value: a worker on another machine needs no file of the problem's.

    Attributes:
        problem: the problem, with the content of its files.
        scenarios: the scenarios, the same for every gait.
        fidelity: timestep and integrator.
        key: equal for equal setups, so that a worker compiles each once.
        versions: what the figures depend on beside the setup; a worker has to run the same.
    """

    problem: Problem
    scenarios: tuple[Scenario, ...]
    fidelity: Fidelity
    key: str
    versions: str

    @staticmethod
    def of(problem: Problem, scenarios: Sequence[Scenario], fidelity: Fidelity) -> RobotSetup:
        """Return a robot in some scenarios with its key."""
        problem = carrying(problem)
        file = problem.to_toml(problem.model_path.name)
        content = (file, sorted((problem.carried or {}).items()), tuple(scenarios), repr(fidelity))
        key = hashlib.sha256(repr(content).encode()).hexdigest()
        return RobotSetup(problem, tuple(scenarios), fidelity, key, versions_text())


_simulators: dict[str, tuple[Simulator, Robot]] = {}
_compiling = threading.Lock()


def prepared(setup: RobotSetup) -> tuple[Simulator, Robot]:
    """Return this process's simulator of a setup, compiled on first use."""
    with _compiling:
        if setup.key not in _simulators:
            if setup.versions != versions_text():
                raise GaitoptError(
                    f"--executor: found a worker with {versions_text()}; allowed: {setup.versions}, as here"
                )
            while len(_simulators) >= _KEPT:
                del _simulators[next(iter(_simulators))]
            simulator = Simulator.build(setup.problem, setup.scenarios, setup.fidelity)
            _simulators[setup.key] = simulator, Robot.of(simulator.models[0])
        return _simulators[setup.key]
