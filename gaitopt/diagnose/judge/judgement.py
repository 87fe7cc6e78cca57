"""All candidates judged by one covariance, and again by a covariance that is re-estimated at the leaders.

Small errors do more to some robots than to others: with a payload behind its feet, a percent of a link's mass
decides which foot slips. With the covariance of the nominal robot, such differences would count as evidence.
So robots are perturbed about the leading candidates, and everything is whitened by the covariance that they
give. Then the candidates are ranked again, until the leaders stay the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.firsts import firsts
from gaitopt.diagnose.fit.schedule import finish
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge import evidence
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.gap import GapMeter
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.perturbed import Perturb, PerturbedRobots, perturbed_about
from gaitopt.diagnose.judge.settings import DEFAULT, DiagnosisSettings
from gaitopt.simulation.tolerances import allowed


@dataclass(frozen=True)
class Ranking:
    """Candidates in order of their probability.

    Attributes:
        candidates: the candidates, the most probable first.
        probabilities: their probabilities if one of them is right, shape (candidates,).
    """

    candidates: tuple[Candidate, ...]
    probabilities: NDArray[np.float64]


@dataclass(frozen=True)
class Judgement:
    """The trials and the fits, ranked by one covariance.

    Attributes:
        trial_set: the trials.
        nominal: the trials compared with the nominal robot.
        fits: the effects' fits; none where nothing was fitted.
        sets: sets of effects of any size; None where these were not tried.
        tolerant_robots: the robots with all small errors of the tolerances that gave the covariance, by the
            first covariance; None where the robot is taken to be made exactly.
        settings: tuning constants.
    """

    trial_set: TrialSet
    nominal: Comparison
    fits: tuple[Fit, ...] = ()
    sets: JudgedSets | None = None
    tolerant_robots: PerturbedRobots | None = None
    settings: DiagnosisSettings = DEFAULT

    @property
    def tolerant(self) -> bool:
        """Whether the covariance is that of robots that are a little wrong in everything."""
        return self.tolerant_robots is not None

    def small_errors(self, candidate: Candidate) -> frozenset[str]:
        """Return the effects of a candidate that are no larger than the tolerances allow.

        On an exactly made robot nothing is a small error.
        """
        if not self.tolerant:
            return frozenset()
        tolerances = self.trial_set.problem.file.tolerances
        names = set[str]()
        for h, at in zip(candidate.hypotheses, candidate.at, strict=True):
            low, high = allowed(h.effect.name, h.value(h.neutral), tolerances)
            if low < high and low <= h.value(at) <= high:
                names.add(h.effect.name)
        return frozenset(names)

    @property
    def n_rows(self) -> int:
        """Number of whitened rows."""
        return len(self.trial_set.row_blocks)

    @cached_property
    def none(self) -> Candidate:
        """The candidate without any effect."""
        return Candidate.without_effect(self.trial_set, self.nominal)

    @cached_property
    def singles(self) -> list[Candidate]:
        """The candidates of one effect; those that could not be simulated are left out."""
        return [Candidate.of_fit(fit) for fit in self.fits if len(fit.comparisons) > 1]

    @property
    def first(self) -> Candidate:
        """The most probable candidate."""
        return self.ranking.candidates[0]

    @cached_property
    def ranking(self) -> Ranking:
        """Sets where these were tried, else candidates of one effect; the most probable first."""
        if self.sets is not None:
            if not self.sets.candidates:
                return Ranking((), np.empty(0))
            return Ranking(self.sets.candidates, evidence.probabilities(self.sets.scores))
        if not self.singles:
            return Ranking((), np.empty(0))
        weights = self.scores(self.singles)
        order = np.argsort(-weights, kind="stable")
        ordered = tuple(self.singles[i] for i in order)
        return Ranking(ordered, evidence.probabilities(weights[order]))

    @property
    def chances(self) -> NDArray[np.float64]:
        """The probability of each candidate, and that of no effect after them, shape (candidates + 1,)."""
        candidates = self.ranking.candidates
        if not candidates:
            return np.ones(1)
        if self.sets is not None:
            return evidence.probabilities(np.append(self.sets.scores, self.sets.none))
        return evidence.probabilities(self.scores([*candidates, self.none]))

    def meter(self, seed: int) -> GapMeter:
        """Return what measures the held-out gap of a candidate; the seed is that of resampled blocks."""
        return GapMeter(self.trial_set, self.nominal, seed, self.settings.evidence.gap_draws)

    def scores(self, candidates: Sequence[Candidate]) -> NDArray[np.float64]:
        """Return the logarithm of the posterior weight of some candidates, up to a constant."""
        return evidence.scores(self.trial_set, candidates, self.settings.evidence, self.settings.response)

    def refine_covariance(self, context: Context, perturb: Perturb = perturbed_about) -> Judgement:
        """Return the same judgement with the covariance re-estimated at the leading candidates.

        Args:
            context: simulates robots.
            perturb: returns the robots perturbed about a candidate.
        """
        judgement, known = self, set[str]()
        for _ in range(self.settings.covariance.estimates):
            leaders = judgement._contenders()
            names = {candidate.label for candidate in leaders}
            if names <= known:
                break
            initial = judgement.trial_set.initial
            changes = [perturb(initial, candidate, context).changes for candidate in leaders]
            judgement = judgement.rewhitened(initial.with_covariance_of(np.concatenate(changes)))
            known = names
            finish(judgement.fits, context.runner, self.settings.fit)
        return judgement

    def _contenders(self) -> list[Candidate]:
        """Return the first of the candidates that the data cannot rule out, each with other effects."""
        ranking, settings = self.ranking, self.settings
        limit = settings.evidence.in_set * float(ranking.probabilities[0])
        ranked = zip(ranking.candidates, ranking.probabilities.tolist(), strict=True)
        likely = [candidate for candidate, chance in ranked if chance >= limit]
        return firsts(likely, lambda one: frozenset(one.names))[: settings.covariance.contenders]

    def rewhitened(self, trial_set: TrialSet) -> Judgement:
        """Return the same judgement with the trials whitened by another covariance."""
        return replace(
            self,
            trial_set=trial_set,
            nominal=trial_set.rewhiten(self.nominal, self.trial_set),
            fits=tuple(fit.rewhitened(trial_set) for fit in self.fits),
        )
