"""What every solver takes and gives: points, costs, bounds and a solution."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Point = NDArray[np.float64]
Evaluate = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Costs, shape (n,), of candidate points, shape (n, d); all n may be worked on at once."""


class Stop(enum.Enum):
    """Why a solver ended."""

    BUDGET = "the budget of evaluations is spent"
    CONVERGED = "steps and differences in cost became too small"


@dataclass(frozen=True)
class Solution:
    """The best point that a solver saw.

    Attributes:
        x: the point, shape (d,).
        cost: its cost.
        evaluations: how many points were evaluated.
        stop: why it ended.
    """

    x: Point
    cost: float
    evaluations: int
    stop: Stop


class Box:
    """The unit box, open where a coordinate is circular: such a coordinate has no walls."""

    def __init__(self, circular: NDArray[np.bool_]):
        self.circular = circular
        self.low = np.where(circular, -np.inf, 0.0)
        self.high = np.where(circular, np.inf, 1.0)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.circular)
