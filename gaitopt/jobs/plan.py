"""The job `plan`: gaits of the reduced planar model, without MuJoCo."""

from __future__ import annotations

from gaitopt.jobs.inputs import checked_seed
from gaitopt.plan.plan import Plan, Planner, PlanSettings
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem


def plan(problem: Problem, *, seed: int = 1) -> Plan:
    """Plan gaits with the reduced planar model, without MuJoCo's steps.

    Args:
        problem: the problem; it needs a ``[planar]`` section.
        seed: seed of the random starts.

    Raises:
        GaitoptError: the problem has no planar model, or its model does not fit one.
    """
    return Planner(carrying(problem), PlanSettings(seed=checked_seed(seed))).plan()
