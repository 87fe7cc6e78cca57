"""All candidates judged by one covariance, and again by the one that the robots in question teach.

What nobody knows of a robot does more to some robots than to others: with a payload behind its feet, a
percent of a link's mass decides which foot slips. The covariance that the nominal robot teaches would
take that for evidence. So robots are drawn about the candidates that lead, everything is whitened by what
these teach, and the question is asked again, until the leaders stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.fitting import Comparison, Fit, Note, TrialSet, finish
from gaitopt.diagnose.fit.pairs import PairFit
from gaitopt.diagnose.judge import evidence, precision
from gaitopt.diagnose.judge.evidence import Candidate

_CONTENDERS = 3
"""So many candidates at most teach the covariance, one of the same effects."""

_LOOKS = 3
"""How often it is taught anew at most."""


@dataclass(frozen=True)
class Judgement:
    """The trials, the fits, and what they are worth by one covariance.

    Attributes:
        trial_set: the trials.
        nominal: the trials beside the nominal robot.
        fits: the effects' fits.
        pairs: fits of two effects; none where these were not tried.
    """

    trial_set: TrialSet
    nominal: Comparison
    fits: tuple[Fit, ...]
    pairs: tuple[PairFit, ...] = ()

    @cached_property
    def none(self) -> Candidate:
        """The candidate without any effect."""
        return evidence.nothing(self.trial_set, self.nominal)

    @cached_property
    def singles(self) -> list[Candidate]:
        """The candidates of one effect; those that could not be simulated are left out."""
        return [evidence.single(fit) for fit in self.fits if len(fit.comparisons) > 1]

    @cached_property
    def doubles(self) -> list[Candidate]:
        """The candidates of two."""
        return [evidence.double(pair) for pair in self.pairs]

    @property
    def candidates(self) -> list[Candidate]:
        """The candidates of two effects where there are any, else of one."""
        return self.doubles or self.singles

    @property
    def first(self) -> Candidate:
        """The most probable candidate."""
        return self.ranked[0][0]

    @cached_property
    def ranked(self) -> tuple[list[Candidate], NDArray[np.float64]]:
        """The candidates, the most probable first, and their probabilities if one of them is right."""
        weights = evidence.scores(self.trial_set, self.candidates)
        order = np.argsort(-weights, kind="stable")
        return [self.candidates[i] for i in order], evidence.probabilities(weights[order])

    def refine_covariance(self, executor: Executor, seed: int, note: Note) -> Judgement:
        """Return the same with a covariance that those who lead by it have taught.

        Args:
            executor: where robots are simulated.
            seed: seed of the draws.
            note: called as it goes.
        """
        look, known = self, set[str]()
        for _ in range(_LOOKS):
            leaders = look._contenders()
            names = {candidate.label for candidate in leaders}
            if names <= known:
                break
            look, known = look._learn_covariance(leaders, executor, seed), names
            finish(look.fits, executor, note)
        return look

    def _contenders(self) -> list[Candidate]:
        """Return the first of the candidates that the data cannot rule out, each with other effects."""
        chosen: dict[frozenset[str], Candidate] = {}
        order, chances = self.ranked
        for candidate, chance in zip(order, chances.tolist(), strict=True):
            if chance >= evidence.IN_SET * float(chances[0]) and len(chosen) < _CONTENDERS:
                chosen.setdefault(frozenset(candidate.names), candidate)
        return list(chosen.values())

    def _learn_covariance(self, candidates: Sequence[Candidate], executor: Executor, seed: int) -> Judgement:
        first = self.trial_set.first
        drawn = [
            precision.perturbed_about(first, candidate, executor, seed).changes for candidate in candidates
        ]
        trial_set = first.with_covariance_of(np.concatenate(drawn))
        return Judgement(
            trial_set,
            trial_set.rewhiten_comparison(self.nominal, self.trial_set),
            tuple(fit.on(trial_set) for fit in self.fits),
            tuple(pair.on(trial_set) for pair in self.pairs),
        )
