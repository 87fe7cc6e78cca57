"""The job `effects`: what a model may lack."""

from __future__ import annotations

from gaitopt.effects.rows import EffectRow, effect_rows
from gaitopt.problem.model import carrying, nominal_parts
from gaitopt.problem.problem import Problem


def list_effects(problem: Problem | None = None) -> list[EffectRow]:
    """Return one row for each effect of the library: its meaning, parameter, unit and bounds.

    Args:
        problem: a problem, for its own figures and for whether an effect applies to it; without, bounds
            are multiples of what they name.

    Raises:
        GaitoptError: the model does not compile.
    """
    return list(effect_rows(None if problem is None else nominal_parts(carrying(problem))))
