"""Robots as values: everything that a worker needs to simulate one, here or on another machine."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
"""Compiled setups that a worker keeps, the latest ones."""

_KEPT_ROBOTS = 128
"""Compiled robots of scenarios with a robot each that a worker keeps, the latest ones."""


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


@dataclass(frozen=True)
class Prepared:
    """A compiled robot in one scenario.

    Attributes:
        simulator: the simulator.
        scenario: index of the scenario in it.
        robot: what metrics need of the robot.
    """

    simulator: Simulator
    scenario: int
    robot: Robot


_compiled: Kept[str, tuple[Simulator, tuple[Robot, ...]]] = Kept(_KEPT)
_robots: Kept[tuple[str, int], tuple[Simulator, tuple[Robot, ...]]] = Kept(_KEPT_ROBOTS)


def prepared(setup: RobotSetup, scenario: int = 0) -> Prepared:
    """Return this process's simulator of a setup, compiled on first use.

    A scenario whose robot has effects of its own has a simulator of its own. Threads that need the same
    setup wait for one of them to compile it; others continue.

    Args:
        setup: the setup.
        scenario: number of one of its scenarios.

    Raises:
        GaitoptError: this process runs other versions than the setup asks for, or the model does not
            compile.
    """
    if setup.versions != versions_text():
        raise GaitoptError(
            f"--executor: found a worker with {versions_text()}; allowed: {setup.versions}, as here"
        )
    if not any(one.effects for one in setup.scenarios):
        simulator, robots = _compiled.get(setup.key, lambda: _compile(setup.problem, setup.scenarios, setup))
        return Prepared(simulator, scenario, robots[scenario])
    own = setup.scenarios[scenario]
    simulator, robots = _robots.get(
        (setup.key, scenario),
        lambda: _compile(setup.problem.as_robot(own.effects), [replace(own, effects=())], setup),
    )
    return Prepared(simulator, 0, robots[0])


def _compile(
    problem: Problem, scenarios: Sequence[Scenario], setup: RobotSetup
) -> tuple[Simulator, tuple[Robot, ...]]:
    """Return a simulator and the figures of the robot of each scenario: their servos differ."""
    simulator = Simulator.build(problem, scenarios, setup.fidelity)
    return simulator, tuple(Robot.of(model) for model in simulator.models)
