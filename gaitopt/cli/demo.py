"""A first look in under a minute: ArcFold, searched briefly and verified over few scenarios."""

from __future__ import annotations

from dataclasses import replace

from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import Horizon, Scenarios, Simulation

BUDGET = 24
"""Enough to beat the hand-tuned gaits from a plan, not to find the best gait."""


def demo_problem() -> Problem:
    """Return ArcFold with a short horizon, few scenarios and no finer reference."""
    problem = load_problem("arcfold")
    short = Horizon(transient_s=1.0, transient_cycles=1, measured_s=2.0, measured_cycles=1)
    working = problem.simulation.working
    changes = {
        "name": "demo",
        "description": "ArcFold for a first look, with a shorter horizon and fewer scenarios",
        "simulation": Simulation(working=working, reference=working, horizon=short),
        "scenarios": Scenarios(**problem.file.scenarios.model_dump() | {"search": 1, "verification": 4}),
    }
    return replace(problem, file=problem.file.model_copy(update=changes))
