"""Every solver by its name: to add one, write its file and add it here."""

from __future__ import annotations

from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.nelder_mead import NelderMead
from gaitopt.optimise.solvers.solver import Solver

SOLVERS: dict[str, Solver] = {solver.name: solver for solver in (CmaEs(), NelderMead())}
"""The solvers that ``--method`` can name."""
