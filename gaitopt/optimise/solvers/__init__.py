"""Solvers, one a file: a cost, a start and a budget in, a solution out."""
