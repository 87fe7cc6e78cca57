"""Drives that the tests share: commands without a period."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Sampled:
    """Rows of targets, each held until the next one, as a log of commands gives them.

    Attributes:
        time: gait time from which each row holds, s, shape (n,), rising from 0.
        rows: targets, rad, shape (n, nu).
        name: what reports call it.
    """

    time: NDArray[np.float64]
    rows: NDArray[np.float64]
    name: str = "log"
    period_s: None = None
    block_s: float = 0.5
    start: None = None

    @property
    def key(self) -> str:
        """Equal for two logs of the same commands."""
        return hashlib.sha256(self.time.tobytes() + self.rows.tobytes()).hexdigest()

    @property
    def duration_s(self) -> float:
        """How long the log lasts, s."""
        return float(self.time[-1])

    def targets(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the row that holds at gait times t, s, shape (n,): rad, shape (n, nu)."""
        index = np.searchsorted(self.time, np.asarray(t, dtype=float) + 1e-9, side="right") - 1
        held: NDArray[np.float64] = self.rows[np.clip(index, 0, len(self.rows) - 1)]
        return held


def wandering(channels: int, seconds: float, seed: int = 1) -> Sampled:
    """Random commands between -0.5 and 0.5 rad, one row every 0.25 s; nothing repeats."""
    time = np.arange(0.0, seconds + 1e-9, 0.25)
    rows = np.random.default_rng(seed).uniform(-0.5, 0.5, (len(time), channels))
    rows[0] = 0.0
    return Sampled(time, rows)
