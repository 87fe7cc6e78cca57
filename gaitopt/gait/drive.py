"""A drive: what is commanded over time. A periodic gait is one, logged commands are another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Commands = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""What is sent to the servos, rad, shape (n, nu), at gait times on the simulation's clock, s, shape (n,)."""


@runtime_checkable
class Drive(Protocol):
    """What is commanded over time.

    Whatever asks for cycles asks for `period_s` and does without where it is None; everything else
    asks for blocks.
    """

    @property
    def name(self) -> str:
        """What reports call it."""

    @property
    def key(self) -> str:
        """Equal for two drives that command the same, whatever their names."""

    @property
    def period_s(self) -> float | None:
        """Length of a cycle, s; None where nothing repeats."""

    @property
    def block_s(self) -> float:
        """Length of the blocks in which a trial is judged, s: a cycle, where there are cycles."""

    @property
    def duration_s(self) -> float | None:
        """How long it lasts, s; None where it goes on without end."""

    def targets(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the joint targets at gait times t, s, shape (n,): rad, shape (n, nu)."""
