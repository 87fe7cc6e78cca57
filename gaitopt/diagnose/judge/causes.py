"""What may have caused a gap: the verdict, and every effect with its probability and its parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.chance import Chance
from gaitopt.diagnose.judge.ensemble import Ensemble
from gaitopt.diagnose.judge.gap import Gap, GapMeter
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.precision import Interval, Precision, at_clock, mixed
from gaitopt.diagnose.judge.set_verdict import misfit_trials
from gaitopt.diagnose.judge.verdict import Verdict

LEAST_PROBABLE = 0.01
"""Explanations less probable than this are not listed."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A fitted parameter.

    Attributes:
        name: name of the parameter.
        value: its value, in the effect's unit.
        ci90: its 90 % interval.
    """

    name: str
    value: float
    ci90: Interval


@dataclass(frozen=True)
class EffectProbability:
    """One effect, with its most probable target.

    Attributes:
        name: name of the effect.
        target: its most probable target.
        probability: its probability over all targets.
        parameter: its fitted parameter.
        unit: unit of that.
        heldout_shrinkage: share of the gap above the floor that it takes away on held-out data; None where
            there is no gap above the floor.
        heldout_left: mean whitened square that it leaves of held-out data, in the worst trial: 1 for a
            correct model.
        alike: cosine between its signature and that of the first candidate.
        targets: probability of each target, if the cause is in the library.
    """

    name: str
    target: str
    probability: float
    parameter: ParameterEstimate
    unit: str
    heldout_shrinkage: float | None
    heldout_left: float
    alike: float
    targets: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return a row of ``effects`` in ``diagnosis.json``."""
        estimate = self.parameter
        return {
            "name": self.name,
            "target": self.target,
            "probability": self.probability,
            "parameters": {estimate.name: {"value": estimate.value, "ci90": list(estimate.ci90)}},
            "unit": self.unit,
            "heldout_shrinkage": self.heldout_shrinkage,
            "heldout_left": self.heldout_left,
            "alike": self.alike,
            "targets": dict(self.targets),
        }


@dataclass(frozen=True)
class Causes:
    """What may have caused the gap.

    Attributes:
        judgement: the trials and the candidates, by the last covariance.
        answer: the verdict.
        gap: on held-out data; None where nothing was fitted.
        changes: change of the whitened residual with each robot perturbed about the first candidate, shape
            (robots, rows).
        unevenness: by how much the recorded cycles differ, in differences of such robots' cycles.
        seed: seed of all randomness.
        gap_angles: the same of the angles, rad; None where none was measured or nothing was fitted.
        chance: what makes the recorded cycles differ, where they differ much; None where nothing does it.
    """

    judgement: Judgement
    answer: Verdict
    gap: Gap | None
    changes: NDArray[np.float64]
    unevenness: float
    seed: int
    gap_angles: Gap | None = None
    chance: Chance | None = None

    @property
    def verdict(self) -> str:
        """The answer's kind."""
        return self.answer.kind

    @property
    def causes(self) -> list[str]:
        """The effects blamed."""
        return list(self.answer.causes)

    @property
    def ambiguous_with(self) -> list[str]:
        """Effects that the data cannot tell from these."""
        return list(self.answer.ambiguous_with)

    @property
    def other_probability(self) -> float:
        """Probability that the cause is not in the library, or not the only one."""
        return self.answer.other_probability

    @property
    def p_value(self) -> float:
        """p-value: how often chance alone gains as much as the first candidate."""
        return self.answer.p_value

    @property
    def unevenness_left(self) -> float:
        """By how much the recorded cycles differ, in differences of simulated cycles with `chance`."""
        return self.unevenness if self.chance is None else self.chance.left_of(self.unevenness)

    @property
    def trial_set(self) -> TrialSet:
        """The trials."""
        return self.judgement.trial_set

    @property
    def nominal(self) -> Comparison:
        """The trials compared with the nominal robot."""
        return self.judgement.nominal

    @property
    def none(self) -> Candidate:
        """The candidate without effect."""
        return self.judgement.none

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The other candidates, the most probable first."""
        return self.judgement.ranking.candidates

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """Their probabilities, if the cause is in the library, shape (candidates,)."""
        return self.judgement.ranking.probabilities

    @property
    def best(self) -> Candidate | None:
        """The most probable candidate."""
        return self.candidates[0] if self.candidates else None

    def intervals(self, candidate: Candidate) -> list[Interval]:
        """Return a 90 % interval of each parameter of a candidate, in its unit."""
        if self.judgement.sets is not None:
            found = self.judgement.sets.intervals(candidate, self.changes)
        else:
            found = Precision(self.changes, self.judgement.settings).intervals(candidate)
        step_s = self.trial_set.simulator.fidelity.timestep_s
        parts = zip(candidate.hypotheses, candidate.at, found, strict=True)
        return [at_clock(h, h.value(at), ends, step_s) for h, at, ends in parts]

    @cached_property
    def effects(self) -> list[EffectProbability]:
        """Every effect with its most probable target, the most probable first."""
        firsts: dict[str, tuple[Candidate, int]] = {}
        totals: dict[str, float] = {}
        targets: dict[str, dict[str, float]] = {}
        for candidate, chance in zip(self.candidates, self.probabilities.tolist(), strict=True):
            for index, hypothesis in enumerate(candidate.hypotheses):
                name, target = hypothesis.effect.name, hypothesis.target
                firsts.setdefault(name, (candidate, index))
                totals[name] = totals.get(name, 0.0) + self._of_library * chance
                own = targets.setdefault(name, {})
                own[target] = own.get(target, 0.0) + chance
        rows = [
            self._effect(candidate, index, totals[name], targets[name])
            for name, (candidate, index) in firsts.items()
        ]
        return sorted(rows, key=lambda row: -row.probability)

    def gap_of_trial(self, trial: int, floor: float) -> Gap | None:
        """Return the held-out gap of one trial, its floor given in m; None where nothing was fitted."""
        if self.gap is None or self.best is None:
            return None
        return self.meter.measure(self.best, floor, trial)

    @property
    def _of_library(self) -> float:
        """What probabilities are multiplied with: an effect of a set may be at work beside something else."""
        return 1.0 if self.judgement.sets is not None else 1.0 - self.other_probability

    @cached_property
    def ensemble(self) -> Ensemble | None:
        """Robots that are a little wrong in everything; None where the robot is taken to be made exactly."""
        return Ensemble.of(self.judgement)

    @cached_property
    def meter(self) -> GapMeter:
        """What measures the held-out gap of a candidate."""
        return self.judgement.meter(self.seed)

    def _effect(
        self, candidate: Candidate, index: int, probability: float, targets: Mapping[str, float]
    ) -> EffectProbability:
        hypothesis, at = candidate.hypotheses[index], candidate.at[index]
        effect, ends = hypothesis.effect, self._interval(candidate, index)
        estimate = ParameterEstimate(effect.parameter, hypothesis.value(at), ends)
        shrinkage = self._shrinkage(candidate)
        return EffectProbability(
            effect.name,
            hypothesis.target,
            probability,
            estimate,
            effect.unit,
            shrinkage,
            candidate.left(self.trial_set),
            candidate.cosine(self.candidates[0], self.nominal),
            targets,
        )

    def _interval(self, first: Candidate, index: int) -> Interval:
        """Return the 90 % interval of an effect's parameter over all sets that have it on that target.

        It holds what the first of them fits. Sets of little probability are left out.

        Args:
            first: the most probable set that has it,
            index: at which place.
        """
        h, at = first.hypotheses[index], first.at[index]
        found = [
            (chance, own, ends)
            for other, chance, intervals in self._probable
            for one, own, ends in zip(other.hypotheses, other.at, intervals, strict=True)
            if one.name == h.name
        ]
        if not found:
            return self.intervals(first)[index]
        if len(found) == 1:
            return found[0][2]
        low, high = mixed(
            [
                (chance, own, (h.coordinate(below), h.coordinate(above)))
                for chance, own, (below, above) in found
            ]
        )
        return h.value(min(low, at)), h.value(max(high, at))

    @cached_property
    def _probable(self) -> list[tuple[Candidate, float, list[Interval]]]:
        """The candidates that are not improbable, and the first, with their probabilities and intervals."""
        rows: list[tuple[Candidate, float, list[Interval]]] = []
        for candidate, chance in zip(self.candidates, self.probabilities.tolist(), strict=True):
            if chance >= LEAST_PROBABLE or not rows:
                rows.append((candidate, chance, self.intervals(candidate)))
        return rows

    def _shrinkage(self, candidate: Candidate) -> float | None:
        """Return the share of the gap above the floor that a candidate takes away on held-out data."""
        if len(self.trial_set.sample_blocks) == 0 and self.gap_angles is not None:
            return self.meter.measure_angles(candidate, self.gap_angles.floor).shrinkage
        return self.meter.measure(candidate, self.gap.floor).shrinkage if self.gap else None

    @cached_property
    def misfit_trials(self) -> dict[str, float]:
        """Trials that the first set does not fit: how many times the median trial each leaves."""
        sets = self.judgement.sets
        return misfit_trials(self.judgement, sets) if sets is not None and sets.candidates else {}

    @property
    def explanations(self) -> list[dict[str, Any]]:
        """Sets of effects with their probabilities, the most probable first: rows of ``diagnosis.json``."""
        return [
            self._explanation(candidate, self._of_library * chance, intervals)
            for candidate, chance, intervals in self._probable
        ]

    def _explanation(
        self, candidate: Candidate, probability: float, intervals: Sequence[Interval]
    ) -> dict[str, Any]:
        parts = zip(candidate.hypotheses, candidate.at, intervals, strict=True)
        return {
            "effects": [
                {
                    "name": h.effect.name,
                    "target": h.target,
                    "parameters": {h.effect.parameter: {"value": h.value(at), "ci90": list(ends)}},
                }
                for h, at, ends in parts
            ],
            "probability": probability,
            "heldout_left": candidate.left(self.trial_set),
        }
