"""Robots as values: everything that a worker needs to simulate one, here or on another machine."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from gaitopt.core.errors import GaitoptError
from gaitopt.core.kept import Kept
from gaitopt.core.versions import versions_text
from gaitopt.problem.model import carrying, content_of
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

_KEPT = 8
"""Compiled robots that a worker keeps, the latest ones."""


@dataclass(frozen=True)
class RobotSetup:
    """What a gait is evaluated with: the robot, the scenarios, the fidelity.

    It is a value: a worker on another machine needs no file of the problem's.

    Attributes:
        problem: the problem, with the content of its files.
        scenarios: the scenarios, the same for every gait.
        fidelity: timestep and integrator.
        key: equal for equal setups, so that a worker compiles each once.
        versions: versions of the packages that decide the bits; a worker must run the same.
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
        content = (*content_of(problem), tuple(scenarios), repr(fidelity))
        key = hashlib.sha256(repr(content).encode()).hexdigest()
        return RobotSetup(problem, tuple(scenarios), fidelity, key, versions_text())


_compiled: Kept[str, tuple[Simulator, Robot]] = Kept(_KEPT)


def prepared(setup: RobotSetup) -> tuple[Simulator, Robot]:
    """Return this process's simulator of a setup, compiled on first use.

    Threads that need the same setup wait for one of them to compile it; others continue.

    Raises:
        GaitoptError: this process runs other versions than the setup asks for, or the model does not
            compile.
    """
    if setup.versions != versions_text():
        raise GaitoptError(
            f"--executor: found a worker with {versions_text()}; allowed: {setup.versions}, as here"
        )
    return _compiled.get(setup.key, lambda: _compile(setup))


def _compile(setup: RobotSetup) -> tuple[Simulator, Robot]:
    simulator = Simulator.build(setup.problem, setup.scenarios, setup.fidelity)
    return simulator, Robot.of(simulator.models[0])
