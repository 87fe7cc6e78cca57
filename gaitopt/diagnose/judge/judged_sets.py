"""Sets of effects in order of their probability, and how well their parameters are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import NORMAL_95
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.chords import WideChords
from gaitopt.diagnose.judge.evidence import probabilities
from gaitopt.diagnose.judge.precision import Interval
from gaitopt.diagnose.judge.set_judge import RankedSets, SetJudge

Array = NDArray[np.float64]

_NONE: Mapping[str, Interval] = MappingProxyType({})


@dataclass(frozen=True)
class JudgedSets:
    """Sets of effects in order of their probability.

    Attributes:
        judge: their judge.
        candidates: the sets, the most probable first; the empty set is left out.
        scores: logarithm of the posterior weight of each, up to a constant, shape (candidates,).
        none: the same of the empty set.
        changes: what each effect of a set changes, see `SetJudge.changes`; simulated for the probable sets.
        timestep: what a finer timestep changes of the whitened residual of the first set, shape (rows,).
        known: intervals of the effects that are at work as other evidence says: they are in every set.
        shifts: by how much the parameter of another effect may be less or more than its fit says.
        wide: slopes over wide chords, and how rough the loss of each trial is; None without a set.
    """

    judge: SetJudge
    candidates: tuple[Candidate, ...]
    scores: Array
    none: float
    changes: tuple[Mapping[str, float], ...]
    timestep: Array
    known: Mapping[str, Interval] = field(default_factory=dict)
    shifts: Mapping[str, Interval] = field(default_factory=dict)
    wide: WideChords | None = None

    @staticmethod
    def of(
        judge: SetJudge,
        ranked: RankedSets,
        known: Mapping[str, Interval] = _NONE,
        shifts: Mapping[str, Interval] = _NONE,
    ) -> JudgedSets:
        """Return ranked sets with what is simulated about the probable ones.

        Args:
            judge: their judge.
            ranked: the sets.
            known: intervals of the effects that other evidence shows; the empty set is then impossible.
            shifts: by how much parameters of other effects may then differ from their fit.
        """
        fits, candidates, scores = ranked.fits, ranked.candidates, ranked.scores
        none = -math.inf if known else ranked.none
        if not fits:
            return JudgedSets(
                judge, (), scores, none, (), np.zeros(len(judge.loss.row_trials)), known, shifts
            )
        probable = max(1, int(np.sum(probabilities(scores) >= judge.settings.probable)))
        timestep = judge.timestep_change(fits[0])
        changes = judge.simulated_changes(fits[:probable], timestep)
        changes += [judge.changes(fit) for fit in fits[probable:]]
        wide = WideChords.of(judge.fitter, fits[:1]).together()
        return JudgedSets(judge, candidates, scores, none, tuple(changes), timestep, known, shifts, wide)

    @property
    def scores_if_usual(self) -> Array:
        """The scores if no effect were less usual than others, shape (candidates,)."""
        unusual = [sum(one.effect.unusual for one in c.hypotheses) for c in self.candidates]
        return self.scores + 0.5 * np.array(unusual, dtype=float)

    def doubtful(self, changes: Array) -> frozenset[str]:
        """Return the effects of the first set whose intervals hold their neutral values.

        Args:
            changes: change of the whitened residual with each perturbed robot, shape (robots, rows).
        """
        first = self.candidates[0]
        pairs = zip(first.hypotheses, self.intervals(first, changes), strict=True)
        return frozenset(h.effect.name for h, (low, high) in pairs if low <= h.value(h.neutral) <= high)

    def intervals(self, candidate: Candidate, changes: Array) -> list[Interval]:
        """Return a 90 % interval of each parameter of a set, in its unit."""
        if candidate.together is None:
            raise ValueError("the candidate is no set of effects")
        return self.intervals_by(candidate.together, self.covariance(candidate.together, changes))

    def intervals_by(self, fit: SetFit, covariance: Array) -> list[Interval]:
        """Return the same of a set whose parameters have a covariance, in squares of ranges, shape (k, k)."""
        parts = zip(fit.hypotheses, set_intervals(fit, covariance), strict=True)
        return [self.known.get(h.name, self._shifted(h, interval)) for h, interval in parts]

    def other_intervals(self, fit: SetFit, covariance: Array) -> dict[str, Interval]:
        """Return those of them that do not follow from the fit alone, by the effects' names."""
        parts = zip(fit.hypotheses, self.intervals_by(fit, covariance), strict=True)
        return {h.name: ends for h, ends in parts if h.name in self.known or h.effect.name in self.shifts}

    def _shifted(self, h: Hypothesis, interval: Interval) -> Interval:
        """Return the interval of a parameter that may be less or more than its fit says, in its unit."""
        if h.effect.name not in self.shifts:
            return interval
        less, more = self.shifts[h.effect.name]
        return max(interval[0] + less, h.value(h.low)), min(interval[1] + more, h.value(h.high))

    def covariance(self, fit: SetFit, changes: Array) -> Array:
        """Return the covariance of a set's parameters, in squares of their ranges, shape (k, k).

        It is the sum of three: that of the fit, and those of the shifts of the fit with perturbed robots and
        with a finer timestep. That of the fit is the larger one of what the curvature of the loss and what
        the scatter of the trials' gradients say. Where servos or feet stick and slip, the loss has many
        valleys, and a fit ends in any whose depths differ by no more than the loss is rough: r standard
        errors away the loss rises by r squared. So a rough trial tells less.

        Args:
            fit: the set.
            changes: change of the whitened residual with each perturbed robot, shape (robots, rows).
        """
        loss, fitter = self.judge.loss, self.judge.fitter
        weights = loss.weights_of(fit.robot.whitened)
        told = weights
        if self.wide is not None:
            fit, told = self.wide.of_set(fit), weights / (1.0 + self.wide.roughness)
        inverse = np.linalg.pinv(fitter.curvature(fit, told))
        alike = changes / math.sqrt(max(1, len(changes)))
        shifts = np.vstack([*alike, self.timestep]) @ (told[loss.row_trials][:, None] * fit.slopes) @ inverse
        grown = self._grown(fit, weights)
        spread: Array = inverse * np.outer(grown, grown) + shifts.T @ shifts
        return spread

    def _grown(self, fit: SetFit, weights: Array) -> Array:
        """Return how much more the fit scatters than its curvature says, at least 1, shape (k,).

        Args:
            fit: the set.
            weights: of each trial, shape (trials,).
        """
        inverse = np.linalg.pinv(self.judge.fitter.curvature(fit, weights))
        gradients = weights[:, None] * fit.rows.by_trial(fit.products.mixed)
        count, k = len(weights), len(fit.hypotheses)
        scatter = gradients.T @ gradients * count / max(1, count - k)
        sandwich = inverse @ scatter @ inverse
        grown: Array = np.sqrt(np.maximum(1.0, np.diag(sandwich) / np.maximum(np.diag(inverse), 1e-300)))
        return grown


def set_intervals(fit: SetFit, covariance: Array) -> list[Interval]:
    """Return a 90 % interval of each parameter of a set, in its unit.

    Args:
        fit: the set.
        covariance: of its parameters, in squares of their ranges, shape (k, k).
    """
    halves = NORMAL_95 * np.sqrt(np.diag(covariance))
    intervals = []
    for h, share, half in zip(fit.hypotheses, fit.shares.tolist(), halves.tolist(), strict=True):
        low, high = h.share_limits
        ends = (min(max(share + side * half, low), high) for side in (-1.0, 1.0))
        below, above = (h.value(h.coordinate_at(end)) for end in ends)
        intervals.append((below, above))
    return intervals
