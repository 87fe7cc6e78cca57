"""Outcomes of gaits that are made up, and problems that judge them."""

from __future__ import annotations

from dataclasses import replace

from helpers import STRIDER

from gaitopt.optimise.evaluator import Outcome
from gaitopt.problem.objective import Constraint, Objective
from gaitopt.problem.problem import Problem, load_problem

LIMITS = {"sideways_ratio": Constraint(max=0.1, scale=0.1), "tilt_rad": Constraint(max=0.5, scale=0.1)}

FAST = Objective(terms={"speed_m_s": -1.0}, penalty=0.05, constraints=LIMITS)
"""Fast, straight and upright."""

_NOMINAL = load_problem(STRIDER)


def looking_for(objective: Objective) -> Problem:
    """A problem with another objective."""
    return replace(_NOMINAL, file=_NOMINAL.file.model_copy(update={"objective": objective}))


def walk(speed: float, drift: float, tilt: float = 0.1, status: str = "ok") -> Outcome:
    """What a gait does on one robot."""
    return Outcome({"speed_m_s": speed, "sideways_ratio": drift, "tilt_rad": tilt}, status, 1.0)
