"""ArcFold's parts, and its motion without effects."""

import pytest

from gaitopt.effects.parts import Parts
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


@pytest.fixture(scope="module")
def nominal(arcfold: Problem) -> Parts:
    return nominal_parts(arcfold)


@pytest.fixture(scope="module")
def reference(arcfold: Problem) -> Trajectory:
    return Simulator.build(arcfold).run(arcfold.baselines["square-1s"], duration=0.6)
