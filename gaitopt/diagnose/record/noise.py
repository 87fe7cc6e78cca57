"""Size of a series: its noise, its resolution, and how far it moves within a block."""

from __future__ import annotations

import numpy as np

from gaitopt.core.statistics import noise_sd, uniform_sd
from gaitopt.diagnose.record.trial import Series, Trial


def noise_of(series: Series) -> float:
    """Return the standard deviation of a series' noise, estimated from its second differences.

    A series that is rounded to a quantum has at least the noise of rounding, quantum / sqrt(12).

    Args:
        series: evenly sampled, finite, shape (n,).
    """
    spread = noise_sd(series, 2) if len(series) > 2 else 0.0
    return max(spread, uniform_sd(quantum_of(series)))


def quantum_of(series: Series) -> float:
    """Return the step to which a series is rounded; 0 where its values do not repeat."""
    steps = np.abs(np.diff(series))
    moved = steps[steps > 0.0]
    if len(moved) == 0 or len(moved) > 0.8 * len(steps):
        return 0.0
    return float(np.quantile(moved, 0.05, method="higher"))


def block_range(trial: Trial, name: str) -> float:
    """Return how far a signal moves within a block, the median over the blocks, m or rad."""
    time, series = trial.counted(name)
    number = ((time - time[0]) / trial.drive.block_s).astype(int)
    blocks = np.split(series, np.flatnonzero(np.diff(number)) + 1)
    return float(np.median([np.ptp(block) for block in blocks]))
