"""Drives: what is commanded over time. A periodic gait is one kind; logged commands are another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Commands = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""What is sent to the servos, rad, shape (n, nu), at gait times on the simulation's clock, s, shape (n,).

NaN: the servo is unpowered. What changes commands keeps NaN where it is.
"""


@runtime_checkable
class Drive(Protocol):
    """What is commanded over time.

    Code that needs cycles asks for `period_s`, and leaves its figures out where that is None. All other code
    asks for blocks.
    """

    @property
    def name(self) -> str:
        """Its name in reports."""

    @property
    def key(self) -> str:
        """Equal for two drives with the same commands, also if their names differ."""

    @property
    def period_s(self) -> float | None:
        """Length of a cycle, s; None where nothing repeats."""

    @property
    def block_s(self) -> float:
        """Length of the blocks in which a trial is judged, s: one cycle where there are cycles."""

    @property
    def duration_s(self) -> float | None:
        """How long it lasts, s; None where it has no end."""

    @property
    def start(self) -> Mapping[str, float] | None:
        """Angle at which joints rest at gait time 0, rad by name; None for the problem's start."""

    def targets(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the joint targets at gait times t, s, shape (n,): rad, shape (n, nu); NaN: unpowered."""
