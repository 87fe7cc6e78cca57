"""The marker's gap on held-out data, before and after a candidate, with an interval over resampled blocks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.robot.signals import is_position

Array = NDArray[np.float64]

_QUANTILES = (0.05, 0.95)


@dataclass(frozen=True)
class Gap:
    """The marker's gap, or that of the angles.

    Attributes:
        before, after: RMS error without and with the effects, m or rad.
        floor: RMS error of a correct model, m or rad.
        ci90: 90 % interval of the shrinkage.
    """

    before: float
    after: float
    floor: float
    ci90: tuple[float, float]

    @property
    def shrinkage(self) -> float | None:
        """Share of the gap above the floor that is removed; None if nothing is above it."""
        return shrinkage(self.before, self.after, self.floor)

    @property
    def closed(self) -> bool:
        """Whether the effects take the gap from above its floor to within it."""
        return self.after <= self.floor < self.before

    def to_dict(self) -> dict[str, object]:
        """Return ``gap`` of ``diagnosis.json``."""
        return self._figures("m")

    def to_dict_in_rad(self) -> dict[str, object]:
        """Return ``gap_angles`` of ``diagnosis.json``: the gap is one of angles."""
        return self._figures("rad")

    def _figures(self, unit: str) -> dict[str, object]:
        return {
            f"heldout_before_{unit}": self.before,
            f"heldout_after_{unit}": self.after,
            f"floor_{unit}": self.floor,
            "shrinkage": self.shrinkage,
            "shrinkage_ci90": list(self.ci90),
        }


def shrinkage(before: float, after: float, floor: float) -> float | None:
    """Return (before - after) / (before - floor); None where the gap is within the floor."""
    return (before - after) / (before - floor) if before > floor else None


@dataclass(frozen=True)
class _Squares:
    """Squared marker errors of each block.

    Attributes:
        before, after: sums of squares without and with the effect, m², shape (blocks,).
        samples: number of samples in time, shape (blocks,).
    """

    before: Array
    after: Array
    samples: Array

    def rms(self, squares: Array, weights: Array) -> float:
        """Return the RMS error over weighted blocks, m."""
        total = float(weights @ self.samples)
        return math.sqrt(float(weights @ squares) / total) if total > 0.0 else 0.0

    def gap(self, weights: Array, floor: float, resampled: Iterable[Array]) -> Gap:
        """Return the gap over weighted blocks, its interval over resampled ones."""
        drawn = []
        for own in resampled:
            share = shrinkage(self.rms(self.before, own), self.rms(self.after, own), floor)
            if share is not None:
                drawn.append(share)
        low, high = np.quantile(drawn, _QUANTILES).tolist() if drawn else (math.nan, math.nan)
        return Gap(self.rms(self.before, weights), self.rms(self.after, weights), floor, (low, high))


@dataclass(frozen=True)
class GapMeter:
    """Measures the gap of candidates.

    Attributes:
        trial_set: the trials.
        nominal: the trials compared with the nominal robot.
        seed: seed of the resampled blocks.
        draws: number of resamplings.
    """

    trial_set: TrialSet
    nominal: Comparison
    seed: int
    draws: int

    @cached_property
    def _drawn(self) -> list[Array]:
        """How often each block is drawn in each resampling; each array of shape (blocks,)."""
        rng = generator(self.seed, Stream.GAP_BOOTSTRAP)
        return [resampled(self.trial_set.block_trials, rng) for _ in range(self.draws)]

    def measure(self, candidate: Candidate, floor: float, trial: int | None = None) -> Gap:
        """Return the marker's gap before and after a candidate.

        Args:
            candidate: the candidate.
            floor: the marker's floor, m.
            trial: one trial; None for all together.
        """
        each = [max(1, sum(map(is_position, one.bins.rows))) for one in self.trial_set.trials]
        axes = np.array(each)[self.trial_set.block_trials]
        residuals = self.nominal.marker, candidate.marker
        return self._gap(residuals, self.trial_set.sample_blocks, axes, floor, trial)

    def measure_angles(self, candidate: Candidate, floor: float, trial: int | None = None) -> Gap:
        """Return the same of the angles, rad; one sample is one angle at one time."""
        residuals = self.nominal.angles, candidate.angles
        return self._gap(residuals, self.trial_set.angle_blocks, np.array(1), floor, trial)

    def _gap(
        self,
        residuals: tuple[Array, Array],
        blocks: NDArray[np.intp],
        axes: NDArray[np.int_],
        floor: float,
        trial: int | None,
    ) -> Gap:
        trial_set, count = self.trial_set, self.trial_set.n_blocks
        before, after = (
            np.bincount(blocks, residual**2, minlength=count).astype(float) for residual in residuals
        )
        samples = np.bincount(blocks, minlength=count) / axes
        groups = trial_set.block_trials
        weights = np.ones(count) if trial is None else (groups == trial).astype(float)
        drawn = (weights * counts for counts in self._drawn)
        return _Squares(before, after, samples).gap(weights, floor, drawn)


def resampled(groups: NDArray[np.intp], rng: np.random.Generator) -> Array:
    """Return how often each block is drawn when blocks are resampled within their group, shape (blocks,)."""
    counts = np.zeros(len(groups))
    for group in np.unique(groups):
        own = np.flatnonzero(groups == group)
        counts += np.bincount(rng.choice(own, len(own)), minlength=len(groups))
    return counts
